#pragma once

#include <gmock/gmock.h>
#include <gtest/gtest.h>

#include <cstdlib>
#include <filesystem>
#include <fstream>
#include <string>
#include <vector>

#include "apgm/core/error.hpp"
#include "apgm/core/map.hpp"
#include "converters/common/converter.hpp"
#include "temp_dir.hpp"

namespace apgm::converters::testing {

using test::TempDir;

inline std::string write_text(const std::string& path, const std::string& bytes) {
  std::ofstream(path, std::ios::binary) << bytes;
  return path;
}

inline std::string read_text(const std::string& path) { return test::read_file(path); }

/// A real recording, or "" with the reason to skip.
inline std::string real_data(const std::string& name) {
  const char* dir = std::getenv("APGM_REAL_DATA");
  const std::string path = std::string(dir != nullptr ? dir : APGM_SOURCE_DIR "/../shared/data") + "/" + name;
  return std::filesystem::exists(path) ? path : "";
}

struct Collected {
  std::vector<Finding> list;
  Findings sink() {
    return [this](const Finding& f) { list.push_back(f); };
  }
  std::vector<std::string> of(Finding::Kind kind) const {
    std::vector<std::string> texts;
    for (const auto& f : list) {
      if (f.kind == kind) texts.push_back(f.text);
    }
    return texts;
  }
  std::vector<std::string> losses() const { return of(Finding::Kind::kLoss); }
};

/// All of a source in memory; checks order, masses and the summary on the way.
/// @param exact  a source that is not regridded: it lists no patch or layer without data
inline Map collect(const PatchSource& source, bool exact = true) {
  Map map(source.header());
  MapSink sink(map);
  const auto cursor = source.patches();
  PatchInfo patch;
  std::optional<std::uint64_t> last;
  std::uint64_t layers = 0;
  while (cursor->next(patch)) {
    const std::uint64_t key = curve_key(patch.patch);
    EXPECT_TRUE(!last || *last < key) << "patches out of order";
    last = key;
    std::vector<Parcel> parcels;
    for (const LayerInfo& info : patch.layers) {
      Parcel parcel;
      parcel.patch = info.patch;
      parcel.type = info.type;
      source.load(info, parcel.cells);
      EXPECT_EQ(parcel.cells.step(), info.step);
      sink.pack(parcel);
      EXPECT_FALSE(exact && parcel.state == Parcel::State::kNothing) << "a layer without data was listed";
      parcels.push_back(std::move(parcel));
      ++layers;
    }
    sink.put(patch.patch, parcels);
  }
  std::uint64_t summed = 0;
  for (const auto& type : source.summary().types) summed += type.layers;
  EXPECT_EQ(summed, layers);
  if (exact) {
    EXPECT_EQ(source.summary().patches, map.size());
  }
  return map;
}

inline std::unique_ptr<PatchSource> open(const Converter& converter, const std::string& path,
                                         const Settings& settings = {}, Collected* findings = nullptr) {
  return converter.open({path, settings, findings != nullptr ? findings->sink() : Findings()});
}

inline void write(const Converter& converter, const PatchSource& source, const std::string& path,
                  const Settings& settings = {}, Collected* findings = nullptr, const std::string& layer = "",
                  bool overwrite = false) {
  WriteRequest request;
  request.path = path;
  request.layer = layer;
  request.settings = settings;
  request.output.overwrite = overwrite;
  if (findings != nullptr) request.run.findings = findings->sink();
  converter.write(source, request);
}

/// Masses of the cell that holds a point; {0, 0} where there is none.
inline std::pair<float, float> masses_at(const Map& map, const std::string& type, double x, double y,
                                         int step) {
  const auto id = map.header().types.find(type);
  const auto at = map.header().frame.cell_at({x, y}, step);
  const Layer* layer = id ? map.find(at.patch, *id) : nullptr;
  if (layer == nullptr) return {0, 0};
  EXPECT_EQ(layer->step(), step);
  return {layer->at(0, at.cell), layer->at(1, at.cell)};
}

/// The Error of an action; fails if there is none.
template <class Action>
Error error_of(Action action) {
  try {
    action();
  } catch (const Error& error) {
    return error;
  }
  ADD_FAILURE() << "no error";
  return Error(ErrorCode::kCancelled, "no error");
}

}  // namespace apgm::converters::testing
