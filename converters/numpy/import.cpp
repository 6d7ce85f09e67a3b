#include "converters/numpy/import.hpp"

#include <algorithm>
#include <filesystem>
#include <fstream>

#include "apgm/core/budget.hpp"
#include "converters/common/file.hpp"
#include "converters/common/grid_fit.hpp"
#include "converters/numpy/array_source.hpp"
#include "converters/numpy/npz_reader.hpp"

namespace apgm::converters {
namespace {

constexpr const char* kMetaEntry = "meta.json";

/// What the arrays of a file may take in memory where no budget says it. A small archive may unpack to a
/// thousand times its size: 1 GiB, or 8 times the file, and 16 GiB at most.
std::uint64_t usual_bound(const std::string& path) {
  constexpr std::uint64_t kLeast = std::uint64_t{1} << 30, kMost = std::uint64_t{1} << 34, kGrowth = 8;
  std::error_code error;
  const std::uint64_t bytes = std::filesystem::file_size(path, error);
  return error ? kLeast : std::clamp(std::min(bytes, kMost) * kGrowth, kLeast, kMost);
}

std::string counted(std::uint64_t n, const char* one, const char* many) {
  return std::to_string(n) + " " + (n == 1 ? one : many);
}

/// Reads arrays one after the other within what memory is given.
class ArrayReader {
 public:
  explicit ArrayReader(const ReadRequest& request)
      : left_(request.max_memory_bytes == 0 ? usual_bound(request.path) : request.max_memory_bytes) {}

  /// @param read  reads one .npy: (bytes at most, header out, rounded out)
  template <class Read>
  CellArray array(const ArrayMeta& meta, Read read) {
    CellArray array;
    array.meta = meta;
    NpyHeader header;
    try {
      array.values = read(left_, header, rounded_);
    } catch (const Error& error) {
      if (const auto hint = budget_hint(error)) {
        throw over_budget("array '" + printable(meta.array) + "': " + error.message(),
                          used_ + (hint->least_mebibytes << 20), "cut the array");
      }
      throw Error(error.code(), "array '" + printable(meta.array) + "': " + error.message())
          .hint(error.hint());
    }
    left_ -= array.values.size() * sizeof(float);
    used_ += array.values.size() * sizeof(float);
    const auto channels = static_cast<std::int64_t>(meta.type.channels.size());
    if (header.shape.size() == 2 && channels == 1) header.shape.insert(header.shape.begin(), 1);
    if (header.shape.size() != 3 || header.shape[0] != channels) {
      throw Error(ErrorCode::kDamaged, "array '" + printable(meta.array) + "' does not have the shape (" +
                                           std::to_string(channels) + ", rows, columns)")
          .hint(std::string("its first axis is the 'channels' of the JSON; ") +
                (channels == 1 ? "one channel may be left out" : "array.reshape and numpy.stack make it so"));
    }
    array.rows = header.shape[1];
    array.columns = header.shape[2];
    for (float& v : array.values) v += 0.0f;  // -0
    return array;
  }

  std::uint64_t rounded() const { return rounded_; }

 private:
  std::uint64_t left_;
  std::uint64_t used_ = 0;
  std::uint64_t rounded_ = 0;
};

struct Arrays {
  NumpyMeta meta;
  std::vector<CellArray> arrays;
  std::uint64_t rounded = 0;
};

Arrays read_npz(const ReadRequest& request) {
  const NpzReader archive(request.path);
  if (!archive.has(kMetaEntry)) {
    throw Error(ErrorCode::kUnsupported,
                "'" + request.path + "' holds no 'meta.json', which says what its arrays mean")
        .hint("docs/converters.md says what stands in it");
  }
  Arrays result;
  result.meta = from_json(archive.text(kMetaEntry, kMostMetaBytes));
  ArrayReader reader(request);
  for (const ArrayMeta& array : result.meta.arrays) {
    result.arrays.push_back(
        reader.array(array, [&](std::uint64_t most, NpyHeader& header, std::uint64_t& rounded) {
          return archive.array(array.array, most, header, rounded);
        }));
  }
  result.rounded = reader.rounded();
  return result;
}

Arrays read_single(const ReadRequest& request) {
  const std::string side = json_beside(request.path);
  std::error_code ignored;
  if (!std::filesystem::exists(side, ignored)) {
    throw Error(ErrorCode::kUnsupported,
                "'" + request.path + "' has no '" + side + "', which says what it means")
        .hint("docs/converters.md says what stands in it");
  }
  Arrays result;
  result.meta = naming(side, [&] { return from_json(read_file(side, kMostMetaBytes)); });
  if (result.meta.arrays.size() != 1) {
    throw Error(ErrorCode::kDamaged, "'" + side + "' tells of " + std::to_string(result.meta.arrays.size()) +
                                         " arrays, and an .npy holds one")
        .hint("an .npz holds several, or none")
        .at(side);
  }
  std::ifstream in(request.path, std::ios::binary);
  if (!in) throw Error(ErrorCode::kUnreadable, "cannot read '" + request.path + "'").at(request.path);
  ArrayReader reader(request);
  result.arrays.push_back(
      reader.array(result.meta.arrays[0], [&](std::uint64_t most, NpyHeader& header, std::uint64_t& rounded) {
        return read_npy(
            [&](std::span<std::byte> out) {
              in.read(reinterpret_cast<char*>(out.data()), static_cast<std::streamsize>(out.size()));
              return static_cast<std::size_t>(in.gcount());
            },
            most, header, rounded);
      }));
  result.rounded = reader.rounded();
  return result;
}

/// The types of the arrays; several arrays may hold one type.
TypeTable types_of(const std::vector<ArrayMeta>& arrays) {
  std::vector<LayerType> types;
  for (const ArrayMeta& array : arrays) {
    const auto it = std::ranges::find(types, array.type.name, &LayerType::name);
    if (it == types.end()) {
      types.push_back(array.type);
    } else if (*it != array.type) {
      throw Error(ErrorCode::kDamaged, "two arrays of layer '" + array.type.name + "' differ in their type")
          .hint("arrays of one layer have the same hypotheses, channels, policy and heights");
    }
  }
  return TypeTable(std::move(types));
}

}  // namespace

std::string json_beside(const std::string& npy) {
  return std::filesystem::path(npy).replace_extension("json").string();
}

void check_array_import(const SettingsReader& settings) { fit_grid({1.0, {}, 0}, settings, {}); }

std::unique_ptr<PatchSource> import_arrays(const ReadRequest& request, const SettingsReader& settings) {
  check_array_import(settings);
  const std::string head = [&] {
    std::ifstream in(request.path, std::ios::binary);
    std::string bytes(2, '\0');
    in.read(bytes.data(), 2);
    return bytes;
  }();
  GridFit fit;
  auto native = naming(request.path, [&] {
    Arrays read = head == "PK" ? read_npz(request) : read_single(request);
    if (read.rounded > 0 && request.findings) {
      request.findings({Finding::Kind::kLoss, counted(read.rounded, "value is rounded to float32",
                                                      "values are rounded to float32")});
    }
    if (read.arrays.empty() && request.findings) {
      request.findings({Finding::Kind::kNote, "the JSON names no layers: the map is empty"});
    }
    MapHeader header;
    header.frame = read.meta.frame;
    read_names(settings, header.frame);
    header.stamp_ns = read.meta.stamp_ns;
    header.types = types_of(read.meta.arrays);
    fit.native = header.frame;
    return std::make_unique<ArraySource>(std::move(header), std::move(read.arrays));
  });
  Frame wanted = fit.native;
  if (const auto edge = settings.number("edge_m", 1e-3, 1e4)) wanted.edge_um = to_micrometres(*edge);
  if (const auto datum = settings.point("datum")) {
    wanted.datum_x_um = to_micrometres(datum->x_m);
    wanted.datum_y_um = to_micrometres(datum->y_m);
  }
  if (wanted != fit.native) fit.target = wanted;
  return place(std::move(native), {fit.native.cell_m(0), fit.native.datum_m(), 0}, fit, request.findings);
}

}  // namespace apgm::converters
