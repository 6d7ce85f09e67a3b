#include "apgm/ops/blame.hpp"

#include <bit>
#include <map>
#include <set>
#include <span>
#include <utility>

#include "apgm/core/error.hpp"
#include "apgm/format/content_id.hpp"

namespace apgm {
namespace {

using History = std::span<const Provenance>;

bool is_known(const LayerType& type, const std::vector<float>& values) {
  for (std::size_t c = 0; c < values.size(); ++c) {
    const float background = type.background(static_cast<int>(c));
    if (std::bit_cast<std::uint32_t>(values[c]) != std::bit_cast<std::uint32_t>(background)) return true;
  }
  return false;
}

/// Follows histories to their ends.
class Walk {
 public:
  Walk(Point point, const std::vector<BlameInput>& inputs) : point_(point), inputs_(inputs) {
    for (std::size_t i = 0; i < inputs.size(); ++i) {
      std::string id = inputs[i].source->content_id();
      ids_.push_back(id.empty() ? content_id_of(*inputs[i].source) : std::move(id));
      by_id_.emplace(ids_.back(), i);
    }
  }

  std::vector<Ancestor> ancestors(History history) {
    std::vector<Ancestor> found;
    // A stack, since a stranger's histories may be long chains.
    std::vector<Task> tasks;
    push(history, 1, tasks);
    while (!tasks.empty()) {
      const Task task = tasks.back();
      tasks.pop_back();
      if (is_content_id(*task.id) && !seen_.insert(*task.id).second) continue;
      Ancestor& ancestor = found.emplace_back();
      ancestor.id = *task.id;
      ancestor.step = task.step;
      ancestor.depth = task.depth;
      History before = task.history.first(task.history.size() - 1);
      if (const auto it = by_id_.find(ancestor.id); it != by_id_.end()) {
        const PatchSource& source = *inputs_[it->second].source;
        ancestor.input = it->second;
        ancestor.cells = known_cells(source, point_);
        before = source.header().history;
      }
      push(before, task.depth + 1, tasks);
    }
    return found;
  }

  std::vector<std::size_t> strangers() const {
    std::vector<std::size_t> inputs;
    for (std::size_t i = 0; i < ids_.size(); ++i) {
      if (!seen_.contains(ids_[i])) inputs.push_back(i);
    }
    return inputs;
  }

 private:
  struct Task {
    const std::string* id;
    History history;  ///< up to the step that the map of this id went into
    std::shared_ptr<const Provenance> step;
    int depth;
  };

  /// The maps that the last step of a history names; the first of them on top.
  void push(History history, int depth, std::vector<Task>& tasks) {
    // The inputs of one step have the same steps before it.
    if (history.empty() || !followed_.insert(&history.back()).second) return;
    const std::vector<std::string>& ids = history.back().inputs;
    const auto step = std::make_shared<const Provenance>(history.back());
    for (auto id = ids.rbegin(); id != ids.rend(); ++id) tasks.push_back({&*id, history, step, depth});
  }

  Point point_;
  const std::vector<BlameInput>& inputs_;
  std::vector<std::string> ids_;
  std::map<std::string, std::size_t> by_id_;
  std::set<std::string> seen_;
  std::set<const Provenance*> followed_;
};

}  // namespace

std::vector<KnownCell> known_cells(const PatchSource& map, Point point) {
  const Frame& frame = map.header().frame;
  std::vector<KnownCell> known;
  PatchIndex at;
  try {
    at = frame.patch_at(point);
  } catch (const Error& e) {
    if (e.code() == ErrorCode::kLimit) return known;  // no patch lies there
    throw;
  }
  PatchInfo patch;
  Layer layer;
  const auto cursor = map.patches(PatchRange{at, at});
  if (!cursor->next(patch)) return known;
  for (const LayerInfo& info : patch.layers) {
    const LayerType& type = map.header().types[info.type];
    map.load(info, layer);
    const CellIndex cell = frame.cell_at(point, info.step).cell;
    KnownCell found{type, info.step, info.stamp_ns, {}};
    for (int c = 0; c < layer.channels(); ++c) found.values.push_back(layer.at(c, cell));
    if (is_known(type, found.values)) known.push_back(std::move(found));
  }
  return known;
}

Blame blame(const PatchSource& map, Point point, const std::vector<BlameInput>& inputs) {
  Blame found;
  found.cells = known_cells(map, point);
  Walk walk(point, inputs);
  found.ancestors = walk.ancestors(map.header().history);
  found.strangers = walk.strangers();
  return found;
}

}  // namespace apgm
