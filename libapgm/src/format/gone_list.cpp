#include "apgm/format/gone_list.hpp"

#include <charconv>
#include <string>
#include <string_view>
#include <utility>

#include "apgm/core/error.hpp"
#include "map_header.hpp"

namespace apgm {
namespace {

/// What `gone` breaks of its rules; nullptr: nothing.
const char* fault(const std::vector<MapChanges::Gone>& gone, const TypeTable& types) {
  const auto place = [](const MapChanges::Gone& g) {
    return std::pair<std::uint64_t, const std::string&>(curve_key(g.patch), g.layer);
  };
  for (std::size_t i = 0; i < gone.size(); ++i) {
    if (!types.find(gone[i].layer)) return "a layer that is gone is of no type of the map";
    if (i > 0 && place(gone[i - 1]) >= place(gone[i])) return "what is gone is not in order";
  }
  return nullptr;
}

std::string to_text(const std::vector<MapChanges::Gone>& gone) {
  std::string text;
  for (const MapChanges::Gone& g : gone) {
    if (!text.empty()) text += ' ';
    text += std::to_string(g.patch.x) + ' ' + std::to_string(g.patch.y) + ' ' + g.layer;
  }
  return text;
}

[[noreturn]] void fail_gone(const std::string& what) {
  throw Error(ErrorCode::kDamaged, "the message cannot be used: " + what);
}

/// Takes words off the front of a text.
class Words {
 public:
  explicit Words(std::string_view text) : rest_(text) {}
  bool empty() const { return rest_.empty(); }
  std::string_view next() {
    const auto end = rest_.find(' ');
    const std::string_view word = rest_.substr(0, end);
    rest_ = end == std::string_view::npos ? std::string_view{} : rest_.substr(end + 1);
    if (word.empty()) fail_gone("its list of what is gone is malformed");
    return word;
  }
  std::int32_t next_number() {
    const std::string_view word = next();
    std::int32_t value = 0;
    const auto [end, error] = std::from_chars(word.data(), word.data() + word.size(), value);
    if (error != std::errc{} || end != word.data() + word.size()) {
      fail_gone("its list of what is gone is malformed");
    }
    return value;
  }

 private:
  std::string_view rest_;
};

std::vector<MapChanges::Gone> parse_gone(std::string_view text) {
  std::vector<MapChanges::Gone> gone;
  for (Words words(text); !words.empty();) {
    MapChanges::Gone g;
    g.patch.x = words.next_number();
    g.patch.y = words.next_number();
    g.layer = words.next();
    gone.push_back(std::move(g));
  }
  // There is one way to write a list: no other spaces, zeros or signs.
  if (to_text(gone) != text) fail_gone("its list of what is gone is malformed");
  return gone;
}

}  // namespace

void store_gone(const std::vector<MapChanges::Gone>& gone, MapHeader& header) {
  if (const char* what = fault(gone, header.types)) {
    throw Error(ErrorCode::kInvalidArgument, "the changes cannot be stored: " + std::string(what));
  }
  header.metadata.erase(kGoneKey);
  if (gone.empty()) return;
  std::string text = to_text(gone);
  if (text.size() > format::kMaxHeaderBytes) {
    throw Error(ErrorCode::kLimit, "the list of " + std::to_string(gone.size()) +
                                       " layers that are gone does not fit a header of 16 MiB")
        .hint("send the map as it is now, whole");
  }
  header.metadata[kGoneKey] = std::move(text);
}

std::vector<MapChanges::Gone> take_gone(MapHeader& header) {
  const auto text = header.metadata.extract(kGoneKey);
  if (text.empty()) return {};
  std::vector<MapChanges::Gone> gone = parse_gone(text.mapped());
  if (const char* what = fault(gone, header.types)) fail_gone(what);
  return gone;
}

}  // namespace apgm
