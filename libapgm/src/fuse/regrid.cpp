#include "apgm/fuse/regrid.hpp"

#include <algorithm>
#include <limits>
#include <tuple>
#include <utility>

#include "apgm/core/budget.hpp"
#include "apgm/core/summary.hpp"
#include "apgm/core/working_memory.hpp"
#include "fuse/regrid_cells.hpp"
#include "fuse/regrid_geometry.hpp"

namespace apgm {
namespace {

using fuse::Grid;
using fuse::Overlap;
using fuse::Pool;

/// Pairs of a source layer and a target patch it meets: what memory a regrid takes.
constexpr std::size_t kMaxLinks = std::size_t{1} << 25;

/// Gathers the cells of one target layer from the source layers that meet it.
class Gatherer {
 public:
  Gatherer(const LayerType& type, Layer& out)
      : model_(fuse::CellModel::make(type)),
        width_(model_->pools().size()),
        out_(out),
        sums_(out.cells() * width_),
        state_(out.cells(), State::kVacuous) {
    for (std::size_t i = 0; i < sums_.size(); ++i) sums_[i] = neutral(model_->pools()[i % width_]);
  }

  void add(const Layer& in, Grid source, Grid target, const fuse::FrameMapping& mapping) {
    values_.resize(in.cells() * width_);
    source_state_.assign(in.cells(), State::kUnread);
    mapping.visit(
        source, target, [&](std::size_t cell) { return measured(in, cell); },
        [&](const Overlap& overlap) { take(in, overlap); });
  }

  void finish() {
    float cell[16];
    for (std::size_t i = 0; i < out_.cells(); ++i) {
      if (state_[i] != State::kPooled) continue;
      model_->restore(&sums_[i * width_], cell);
      for (int c = 0; c < out_.channels(); ++c) out_.plane(c)[i] = cell[c];
    }
  }

 private:
  enum class State : std::uint8_t { kUnread, kVacuous, kPooled, kCopied };

  static double neutral(Pool pool) {
    constexpr double kInf = std::numeric_limits<double>::infinity();
    return pool == Pool::kLeast ? kInf : pool == Pool::kGreatest ? -kInf : 0.0;
  }

  bool measured(const Layer& in, std::size_t cell) {
    State& state = source_state_[cell];
    if (state == State::kUnread) {
      float channels[16];
      for (int c = 0; c < in.channels(); ++c) channels[c] = in.plane(c)[cell];
      state = model_->measure(channels, &values_[cell * width_]) ? State::kPooled : State::kVacuous;
    }
    return state == State::kPooled;
  }

  void take(const Layer& in, const Overlap& overlap) {
    State& state = state_[overlap.target];
    if (overlap.of_source == 1 && overlap.of_target == 1) {
      // The same square: no other cell meets it, and its bits are the answer.
      state = State::kCopied;
      for (int c = 0; c < in.channels(); ++c) out_.plane(c)[overlap.target] = in.plane(c)[overlap.source];
      return;
    }
    if (state == State::kCopied) return;
    state = State::kPooled;
    const double* value = &values_[overlap.source * width_];
    double* sum = &sums_[overlap.target * width_];
    for (std::size_t i = 0; i < width_; ++i) {
      switch (model_->pools()[i]) {
        case Pool::kExtensive:
          sum[i] += overlap.of_source * value[i];
          break;
        case Pool::kIntensive:
          sum[i] += overlap.of_target * value[i];
          break;
        case Pool::kLeast:
          sum[i] = std::min(sum[i], value[i]);
          break;
        case Pool::kGreatest:
          sum[i] = std::max(sum[i], value[i]);
          break;
      }
    }
  }

  std::unique_ptr<fuse::CellModel> model_;
  std::size_t width_;
  Layer& out_;
  std::vector<double> sums_;  // [cell][value]
  std::vector<State> state_;
  std::vector<double> values_;  // of the source cells, [cell][value]
  std::vector<State> source_state_;
};

/// A target layer and the source layers that meet it.
struct Group {
  std::uint64_t key = 0;
  PatchIndex patch;
  TypeId type = 0;
  std::uint8_t step = 0;
  std::int64_t stamp_ns = 0;
  std::size_t first = 0;  // in links
  std::size_t count = 0;
};

class RegridSource final : public PatchSource, public WorkingMemory {
 public:
  RegridSource(const PatchSource& source, const Frame& target, const RigidMotion& motion,
               std::optional<int> step, RegridBudget* budget)
      : source_(source), header_(source.header()), mapping_(source.header().frame, target, motion) {
    if (step && (*step < 0 || *step > kMaxStep)) {
      throw Error(ErrorCode::kLimit, "a resolution step lies in 0..11");
    }
    header_.frame = target;
    reserve(budget);
    collect();
    group(step);
  }

  const MapHeader& header() const override { return header_; }

  /// Layers that turn out vacuous are counted: nothing has been read yet.
  Summary summary() const override {
    Summary s;
    s.types.resize(header_.types.size());
    for (std::size_t i = 0; i < groups_.size(); ++i) {
      const Group& g = groups_[i];
      if (i == 0 || groups_[i - 1].key != g.key) ++s.patches;
      s.range.add(g.patch);
      auto& t = s.types[g.type];
      ++t.layers;
      ++t.layers_at[g.step];
      t.raw_bytes += (std::uint64_t{4} << (2 * g.step)) * header_.types[g.type].channels.size();
    }
    return s;
  }

  std::unique_ptr<PatchCursor> patches(const std::optional<PatchRange>& range) const override;

  void load(const LayerInfo& info, Layer& out) const override {
    if (info.locator >= groups_.size() || groups_[info.locator].patch != info.patch ||
        groups_[info.locator].type != info.type) {
      throw Error(ErrorCode::kInvalidArgument, "the regridded map has no such layer");
    }
    const Group& g = groups_[info.locator];
    const LayerType& type = header_.types[g.type];
    out.reset(type, g.step);
    out.stamp_ns = g.stamp_ns;
    Gatherer gatherer(type, out);
    Layer in;
    for (std::size_t i = 0; i < g.count; ++i) {
      const LayerInfo& from = sources_[links_[g.first + i].source];
      source_.load(from, in);
      gatherer.add(in, {from.patch, in.step()}, {g.patch, g.step}, mapping_);
    }
    gatherer.finish();
  }

  /// A source layer, its cells as doubles and the sums of the target's.
  std::uint64_t working_bytes(std::uint64_t layer_bytes) const override {
    std::uint64_t of_cells = 0, natives = 0;
    const Summary from = source_.summary(), to = summary();
    for (std::size_t t = 0; t < header_.types.size(); ++t) {
      const LayerType& type = header_.types[static_cast<TypeId>(t)];
      const std::uint64_t width = fuse::CellModel::make(type)->pools().size() * sizeof(double) + 1;
      const std::uint64_t source_cells = most_cells(from.types[t]), target_cells = most_cells(to.types[t]);
      of_cells = std::max(of_cells, (source_cells + target_cells) * width);
      natives = std::max(natives, source_cells * type.channels.size() * sizeof(float));
    }
    return of_cells + natives + apgm::working_bytes(source_, std::max(natives, layer_bytes));
  }

  const std::vector<Group>& groups() const { return groups_; }

 private:
  static std::uint64_t most_cells(const Summary::OfType& type) {
    const auto step = finest_step(type);
    return step ? std::uint64_t{1} << (2 * *step) : 0;
  }

  struct Link {
    std::uint64_t key = 0;
    PatchIndex patch;
    std::uint32_t source = 0;
    TypeId type = 0;
    friend bool operator<(const Link& a, const Link& b) {
      return std::tie(a.key, a.type, a.source) < std::tie(b.key, b.type, b.source);
    }
  };

  /// Counts what `collect` and `group` will keep, at most, so that nothing grows and no budget is exceeded.
  void reserve(RegridBudget* budget) {
    std::size_t links = 0, layers = 0;
    const auto cursor = source_.patches();
    PatchInfo info;
    std::vector<PatchIndex> targets;
    while (cursor->next(info)) {
      mapping_.targets_of(info.patch, kMaxLinks, targets);
      if (targets.size() * info.layers.size() > kMaxLinks - links) {
        throw Error(ErrorCode::kLimit, "the target frame has too many patches")
            .hint("choose a larger patch edge");
      }
      links += targets.size() * info.layers.size();
      layers += info.layers.size();
    }
    if (budget != nullptr) {
      const std::uint64_t most = links * (sizeof(Link) + sizeof(Group)) + layers * sizeof(LayerInfo);
      const std::uint64_t least = budget->used_bytes + most;
      if (budget->max_bytes != 0 && least > budget->max_bytes) {
        throw over_budget("the memory budget does not hold the lists of the layers that are regridded", least,
                          "choose a larger patch edge");
      }
      budget->used_bytes = least;
    }
    links_.reserve(links);
    sources_.reserve(layers);
  }

  void collect() {
    const auto cursor = source_.patches();
    PatchInfo info;
    std::vector<PatchIndex> targets;
    while (cursor->next(info)) {
      mapping_.targets_of(info.patch, kMaxLinks, targets);
      for (const LayerInfo& layer : info.layers) {
        for (const PatchIndex t : targets) {
          links_.push_back({curve_key(t), t, static_cast<std::uint32_t>(sources_.size()), layer.type});
        }
        sources_.push_back(layer);
      }
    }
    std::sort(links_.begin(), links_.end());
  }

  void group(std::optional<int> step) {
    std::size_t groups = 0;
    for (std::size_t i = 0; i < links_.size(); ++i) {
      groups += i == 0 || links_[i - 1].key != links_[i].key || links_[i - 1].type != links_[i].type;
    }
    groups_.reserve(groups);
    for (std::size_t i = 0; i < links_.size(); ++i) {
      const Link& link = links_[i];
      const LayerInfo& from = sources_[link.source];
      if (groups_.empty() || groups_.back().key != link.key || groups_.back().type != link.type) {
        groups_.push_back({link.key, link.patch, link.type, 0, 0, i, 0});
      }
      Group& g = groups_.back();
      ++g.count;
      g.stamp_ns = std::max(g.stamp_ns, from.stamp_ns);
      const int wanted = step ? *step : header_.frame.step_for(source_.header().frame.cell_m(from.step));
      g.step = std::max(g.step, static_cast<std::uint8_t>(wanted));
    }
  }

  const PatchSource& source_;
  MapHeader header_;
  fuse::FrameMapping mapping_;
  std::vector<LayerInfo> sources_;
  std::vector<Link> links_;
  std::vector<Group> groups_;
};

class RegridCursor final : public PatchCursor {
 public:
  RegridCursor(const std::vector<Group>& groups, std::optional<PatchRange> range)
      : groups_(groups), range_(range) {}

  bool next(PatchInfo& out) override {
    while (at_ < groups_.size() && range_ && !range_->contains(groups_[at_].patch)) ++at_;
    if (at_ == groups_.size()) return false;
    const std::uint64_t key = groups_[at_].key;
    out.patch = groups_[at_].patch;
    out.layers.clear();
    for (; at_ < groups_.size() && groups_[at_].key == key; ++at_) {
      LayerInfo info;
      info.patch = out.patch;
      info.type = groups_[at_].type;
      info.step = groups_[at_].step;
      info.stamp_ns = groups_[at_].stamp_ns;
      info.locator = at_;
      out.layers.push_back(info);
    }
    return true;
  }

 private:
  const std::vector<Group>& groups_;
  std::optional<PatchRange> range_;
  std::size_t at_ = 0;
};

std::unique_ptr<PatchCursor> RegridSource::patches(const std::optional<PatchRange>& range) const {
  return std::make_unique<RegridCursor>(groups_, range);
}

}  // namespace

std::unique_ptr<PatchSource> regrid(const PatchSource& source, const Frame& target, const RigidMotion& motion,
                                    std::optional<int> step, RegridBudget* budget) {
  return std::make_unique<RegridSource>(source, target, motion, step, budget);
}

}  // namespace apgm
