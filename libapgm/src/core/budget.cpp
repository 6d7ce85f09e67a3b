#include "apgm/core/budget.hpp"

#include <charconv>
#include <utility>

namespace apgm {
namespace {

constexpr std::string_view kAllow = "allow at least ";
constexpr std::string_view kUnit = " MiB";

}  // namespace

Error over_budget(std::string what, std::uint64_t least_bytes, const std::string& else_do) {
  const std::uint64_t mebibytes = (least_bytes >> 20) + ((least_bytes & 0xfffff) != 0);
  std::string hint = std::string(kAllow) + std::to_string(mebibytes) + std::string(kUnit);
  if (!else_do.empty()) hint += ", or " + else_do;
  Error error(ErrorCode::kLimit, std::move(what));
  error.hint(std::move(hint));
  return error;
}

void check_budget(std::uint64_t max_bytes, std::uint64_t need, const std::string& what,
                  const std::string& else_do) {
  if (max_bytes == 0 || need <= max_bytes) return;
  throw over_budget(what + ": that takes " + std::to_string((need >> 20) + 1) + " MiB, more than is allowed",
                    need, else_do);
}

std::optional<BudgetHint> budget_hint(const Error& error) {
  std::string_view hint = error.hint();
  if (error.code() != ErrorCode::kLimit || !hint.starts_with(kAllow)) return {};
  hint.remove_prefix(kAllow.size());
  BudgetHint out;
  const auto [end, fault] = std::from_chars(hint.data(), hint.data() + hint.size(), out.least_mebibytes);
  if (fault != std::errc()) return {};
  hint.remove_prefix(static_cast<std::size_t>(end - hint.data()));
  if (!hint.starts_with(kUnit)) return {};
  out.rest = hint.substr(kUnit.size());
  return out;
}

}  // namespace apgm
