#include "tools/common/source_view.hpp"

#include <fmt/format.h>

#include <algorithm>

#include "apgm/ops/statistics.hpp"
#include "tools/common/exit_code.hpp"
#include "tools/common/json.hpp"
#include "tools/common/suggest.hpp"

namespace apgm::tools {
namespace {

std::vector<std::string> names_of(const TypeTable& types) {
  std::vector<std::string> names;
  for (const LayerType& type : types) names.push_back(type.name);
  return names;
}

PatchRange common(const PatchRange& a, const PatchRange& b) {
  return {{std::max(a.min.x, b.min.x), std::max(a.min.y, b.min.y)},
          {std::min(a.max.x, b.max.x), std::min(a.max.y, b.max.y)}};
}

class ViewCursor final : public PatchCursor {
 public:
  ViewCursor(std::unique_ptr<PatchCursor> cursor, const std::vector<std::optional<TypeId>>& types)
      : cursor_(std::move(cursor)), types_(types) {}

  bool next(PatchInfo& out) override {
    while (cursor_->next(out)) {
      std::erase_if(out.layers, [&](const LayerInfo& layer) { return !types_[layer.type]; });
      for (LayerInfo& layer : out.layers) layer.type = *types_[layer.type];
      if (!out.layers.empty()) return true;
    }
    return false;
  }

 private:
  std::unique_ptr<PatchCursor> cursor_;
  const std::vector<std::optional<TypeId>>& types_;
};

class NoPatches final : public PatchCursor {
 public:
  bool next(PatchInfo&) override { return false; }
};

}  // namespace

SourceView::SourceView(const PatchSource& source, const std::vector<std::string>& layers,
                       const std::optional<Box>& box)
    : source_(source), header_(source.header()), from_source_(header_.types.size()) {
  const std::vector<std::string> names = names_of(header_.types);
  for (const std::string& layer : layers) {
    if (header_.types.find(layer)) continue;
    throw usage_error(
        fmt::format("the map has no layer '{}'", layer),
        names.empty() ? "it has no layers" : did_you_mean(layer, names, "its layers: " + join(names)));
  }
  std::vector<LayerType> kept;
  for (TypeId id = 0; id < header_.types.size(); ++id) {
    const bool wanted = layers.empty() || std::find(layers.begin(), layers.end(), names[id]) != layers.end();
    if (!wanted) continue;
    from_source_[id] = static_cast<TypeId>(kept.size());
    to_source_.push_back(id);
    kept.push_back(header_.types[id]);
  }
  header_.types = TypeTable(std::move(kept));
  if (box) range_ = header_.frame.patches_meeting(*box);
}

std::unique_ptr<PatchCursor> SourceView::patches(const std::optional<PatchRange>& range) const {
  std::optional<PatchRange> both = range_ ? range_ : range;
  if (range_ && range) both = common(*range_, *range);
  if (both && both->empty()) return std::make_unique<NoPatches>();
  return std::make_unique<ViewCursor>(source_.patches(both), from_source_);
}

Summary SourceView::summary() const { return totals_of(*this); }

LayerInfo SourceView::inner(const LayerInfo& info) const {
  LayerInfo layer = info;
  layer.type = to_source_[info.type];
  return layer;
}

void SourceView::load(const LayerInfo& info, Layer& out) const { source_.load(inner(info), out); }

bool SourceView::load_stored(const LayerInfo& info, StoredLayer& out) const {
  return source_.load_stored(inner(info), out);
}

}  // namespace apgm::tools
