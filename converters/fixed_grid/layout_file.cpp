#include "converters/fixed_grid/layout_file.hpp"

#include <flatbuffers/flatbuffers.h>
#include <xxhash.h>

#include <algorithm>
#include <cmath>
#include <cstring>
#include <functional>

#include "apgm/core/error.hpp"
#include "apgm/format/message.hpp"
#include "converters/fixed_grid/raster.hpp"
#include "fixed_grid_generated.h"

namespace apgm::converters {
namespace {

namespace fbs = apgm::fixed_grid::fbs;

constexpr std::uint16_t kVersion = 1;
constexpr std::uint64_t kDefaultMaxBytes = std::uint64_t{4} << 30;
constexpr std::size_t kLengthBytes = 4;
constexpr std::size_t kMostDescriptionBytes = std::size_t{1} << 30;
constexpr const char* kChecksumKey = "fixed_grid.xxh3";

std::int64_t um(double metres) { return std::llrint(metres * 1e6); }
double metres(std::int64_t um) { return static_cast<double>(um) / 1e6; }

[[noreturn]] void fail_damaged(const std::string& what) { throw Error(ErrorCode::kDamaged, what); }

std::vector<PatchIndex> submaps_of(const Layout& layout) {
  std::vector<PatchIndex> all;
  const Frame& frame = layout.frame();
  layout.for_each_block([&](const CellBlock& block) {
    all.push_back({static_cast<std::int32_t>(floor_div(block.x_um - frame.datum_x_um, frame.edge_um)),
                   static_cast<std::int32_t>(floor_div(block.y_um - frame.datum_y_um, frame.edge_um))});
  });
  std::ranges::sort(all);
  return all;
}

flatbuffers::DetachedBuffer description_bytes(const Layout& layout) {
  const LayoutDescription d = layout.describe();
  flatbuffers::FlatBufferBuilder builder;
  std::vector<fbs::Rectangle> rectangles;
  std::vector<fbs::SubMap> submaps;
  for (const LayoutRectangle& r : d.rectangles) {
    rectangles.emplace_back(um(r.x0_m), um(r.x1_m), um(r.y0_m), um(r.y1_m), um(r.dx_m), um(r.dy_m));
  }
  if (!d.moves()) {
    for (const PatchIndex i : submaps_of(layout)) submaps.emplace_back(i.x, i.y);
  }
  const auto name = builder.CreateString(d.name);
  const auto frame_id = builder.CreateString(d.frame.frame_id);
  const auto container = builder.CreateString(std::string(to_string(d.container)));
  const auto rectangle_list = builder.CreateVectorOfStructs(rectangles);
  const auto submap_list = builder.CreateVectorOfStructs(submaps);
  fbs::LayoutBuilder out(builder);
  out.add_version(kVersion);
  out.add_name(name);
  out.add_edge_um(d.frame.edge_um);
  out.add_datum_x_um(d.frame.datum_x_um);
  out.add_datum_y_um(d.frame.datum_y_um);
  out.add_epsg(d.frame.epsg.value_or(0));
  out.add_frame_id(frame_id);
  if (d.moves()) {
    out.add_rectangles(rectangle_list);
    out.add_vehicle_x_um(d.vehicle_x_um);
    out.add_vehicle_y_um(d.vehicle_y_um);
  } else {
    out.add_container(container);
    out.add_cell_um(um(d.cell_m));
    out.add_horizon_um(um(d.horizon_m));
    out.add_submaps(submap_list);
  }
  builder.Finish(out.Finish());
  return builder.Release();
}

LayoutDescription description_of(const fbs::Layout& in) {
  LayoutDescription d;
  d.name = in.name()->str();
  d.frame.edge_um = in.edge_um();
  d.frame.datum_x_um = in.datum_x_um();
  d.frame.datum_y_um = in.datum_y_um();
  if (in.epsg() != 0) d.frame.epsg = in.epsg();
  d.frame.frame_id = in.frame_id()->str();
  d.frame.check();
  if (in.rectangles() != nullptr) {
    for (const fbs::Rectangle* r : *in.rectangles()) {
      d.rectangles.push_back({metres(r->x0_um()), metres(r->x1_um()), metres(r->y0_um()), metres(r->y1_um()),
                              metres(r->dx_um()), metres(r->dy_um())});
    }
    if (d.rectangles.empty()) fail_damaged("the layout has neither rectangles nor sub-maps");
    d.vehicle_x_um = in.vehicle_x_um();
    d.vehicle_y_um = in.vehicle_y_um();
    return d;
  }
  const auto container = submap_container_from(in.container() == nullptr ? "" : in.container()->str());
  if (!container) fail_damaged("the sub-maps have no known container");
  d.container = *container;
  d.cell_m = metres(in.cell_um());
  d.horizon_m = metres(in.horizon_um());
  return d;
}

/// Cells that the description asks for, before any is made.
std::uint64_t cells_of(const LayoutDescription& d, const fbs::Layout& in) {
  if (d.moves()) return NonUniformPlan{d.name, d.rectangles}.cells();
  if (in.submaps() == nullptr) fail_damaged("the layout has neither rectangles nor sub-maps");
  const std::int64_t cell = um(d.cell_m);
  if (cell <= 0 || d.frame.edge_um / cell > (1 << kMaxStep)) fail_damaged("the sub-maps have no cell size");
  const auto side = static_cast<std::uint64_t>(d.frame.edge_um / cell);
  return in.submaps()->size() * side * side;
}

void reserve_submaps(const flatbuffers::Vector<const fbs::SubMap*>& submaps, const Frame& frame,
                     Layout& layout) {
  std::vector<PatchIndex> all;
  for (const fbs::SubMap* i : submaps) all.push_back({i->x(), i->y()});
  if (std::ranges::adjacent_find(all, std::greater_equal<>()) != all.end()) {
    fail_damaged("the sub-maps are not in order");
  }
  if (all.empty()) return;
  // The outermost rows first: a dense array then has its extent, and need not grow with every sub-map.
  const auto [low, high] = std::ranges::minmax_element(all, {}, &PatchIndex::y);
  for (const PatchIndex i : {all.front(), all.back(), *low, *high}) layout.reserve(area_of(frame, i));
  for (const PatchIndex i : all) layout.reserve(area_of(frame, i));
}

std::unique_ptr<Layout> empty_layout(const fbs::Layout& in, const TypeTable& types, std::uint64_t max_bytes) {
  const LayoutDescription d = description_of(in);
  CellSchema schema(types);
  const auto cell_bytes = static_cast<std::uint64_t>(schema.values()) * sizeof(float);
  if (cells_of(d, in) > max_bytes / cell_bytes) {
    throw Error(ErrorCode::kLimit, "the cells of the layout need more memory than is allowed");
  }
  auto layout = make_layout(std::move(schema), d);
  if (d.moves()) return layout;
  reserve_submaps(*in.submaps(), d.frame, *layout);
  return layout;
}

std::string checksum_of(std::span<const std::byte> bytes) {
  constexpr std::string_view kDigits = "0123456789abcdef";
  const std::uint64_t hash = XXH3_64bits(bytes.data(), bytes.size());
  std::string text;
  for (int shift = 60; shift >= 0; shift -= 4) text += kDigits[(hash >> shift) & 15];
  return text;
}

/// The cells as an .apgm file that also holds the checksum of what stands before it.
std::vector<std::byte> pack(Map cells, std::string checksum, int level) {
  MapHeader header = cells.header();
  header.metadata[kChecksumKey] = std::move(checksum);
  Map sealed(std::move(header));
  // Layers move from one map to the other: they are as large as the layout.
  while (cells.size() > 0) {
    const Patch& patch = cells.by_key().begin()->second;
    const PatchIndex index = patch.index;
    const TypeId type = patch.layers.begin()->first;
    sealed.patch(index).layers.emplace(type, *cells.extract(index, type));
  }
  WriterOptions options;
  options.level = level;
  return to_bytes(sealed, options);
}

}  // namespace

std::vector<std::byte> encode_layout(const Layout& layout, int level) {
  const auto description = description_bytes(layout);
  std::vector<std::byte> bytes(kFixedGridMagic.size() + kLengthBytes + description.size());
  std::memcpy(bytes.data(), kFixedGridMagic.data(), kFixedGridMagic.size());
  for (std::size_t i = 0; i < kLengthBytes; ++i) {
    bytes[kFixedGridMagic.size() + i] = static_cast<std::byte>(description.size() >> (8 * i));
  }
  std::memcpy(bytes.data() + kFixedGridMagic.size() + kLengthBytes, description.data(), description.size());

  const auto packed = pack(LayoutRaster(layout.describe()).from_layout(layout), checksum_of(bytes), level);
  bytes.insert(bytes.end(), packed.begin(), packed.end());
  return bytes;
}

std::unique_ptr<Layout> decode_layout(std::span<const std::byte> bytes, std::uint64_t max_bytes) {
  constexpr std::size_t kHead = kFixedGridMagic.size() + kLengthBytes;
  if (bytes.size() < kFixedGridMagic.size() ||
      std::memcmp(bytes.data(), kFixedGridMagic.data(), kFixedGridMagic.size()) != 0) {
    throw Error(ErrorCode::kForeign, "not a fixed-grid file");
  }
  if (bytes.size() < kHead) fail_damaged("the file ends within its head");
  std::size_t length = 0;
  for (std::size_t i = 0; i < kLengthBytes; ++i) {
    length |= static_cast<std::size_t>(bytes[kFixedGridMagic.size() + i]) << (8 * i);
  }
  if (length == 0 || length > bytes.size() - kHead) fail_damaged("the file ends within its description");
  // A verifier takes no more than 2 GiB.
  if (length > kMostDescriptionBytes) fail_damaged("the description of the layout is too long");
  // FlatBuffers wants its start aligned.
  std::vector<std::uint64_t> aligned((length + 7) / 8);
  std::memcpy(aligned.data(), bytes.data() + kHead, length);
  const auto* start = reinterpret_cast<const std::uint8_t*>(aligned.data());
  flatbuffers::Verifier verifier(start, length);
  if (!verifier.VerifyBuffer<fbs::Layout>(nullptr)) fail_damaged("the description of the layout is damaged");
  const auto& in = *flatbuffers::GetRoot<fbs::Layout>(start);
  if (in.version() != kVersion) {
    throw Error(ErrorCode::kUnsupported,
                "fixed-grid version " + std::to_string(in.version()) + " is unknown");
  }
  if (max_bytes == 0) max_bytes = kDefaultMaxBytes;
  const Map cells = map_from_bytes(bytes.subspan(kHead + length), max_bytes);
  const auto checksum = cells.header().metadata.find(kChecksumKey);
  if (checksum == cells.header().metadata.end() ||
      checksum->second != checksum_of(bytes.first(kHead + length))) {
    fail_damaged("the description of the layout does not match its checksum");
  }
  try {
    auto layout = empty_layout(in, cells.header().types, max_bytes);
    LayoutRaster(layout->describe()).to_layout(cells, *layout);
    return layout;
  } catch (const Error& error) {
    // A file has no arguments: what they could not be is damage.
    if (error.code() == ErrorCode::kInvalidArgument) fail_damaged(error.message());
    throw;
  }
}

}  // namespace apgm::converters
