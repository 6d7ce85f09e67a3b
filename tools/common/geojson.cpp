#include "tools/common/geojson.hpp"

#include <fcntl.h>
#include <fmt/format.h>
#include <unistd.h>

#include <cerrno>
#include <cmath>
#include <cstdio>
#include <cstring>
#include <memory>

#include "apgm/core/error.hpp"
#include "tools/common/json.hpp"
#include "tools/common/parse.hpp"

namespace apgm::tools {
namespace {

constexpr std::size_t kMaxFileBytes = std::size_t{64} << 20;
constexpr const char* kHint =
    "an area is a GeoJSON Polygon, MultiPolygon, Feature or FeatureCollection in metres of the map's CRS";

class Areas {
 public:
  explicit Areas(const std::string& path) : path_(path) {}

  void add(const Json& object, const std::string& at) {
    const std::string type = type_of(object, at);
    if (type == "FeatureCollection") {
      const Json& features = member(object, "features", at);
      for (std::size_t i = 0; i < features.size(); ++i) {
        add_feature(features[i], fmt::format("{}features[{}]", prefix(at), i));
      }
    } else if (type == "Feature") {
      add_feature(object, at);
    } else {
      add_geometry(object, type, at);
    }
  }

  Polygon take() {
    if (polygon_.rings.empty()) fail("", "holds no area");
    return std::move(polygon_);
  }

 private:
  [[noreturn]] void fail(const std::string& at, const std::string& what) const {
    const std::string where = at.empty() ? "" : at + " ";
    throw Error(ErrorCode::kForeign, fmt::format("'{}': {}{}", path_, where, what)).hint(kHint).at(path_);
  }

  static std::string prefix(const std::string& at) { return at.empty() ? "" : at + "."; }

  std::string type_of(const Json& object, const std::string& at) const {
    if (!object.is_object()) fail(at, "is not a GeoJSON object");
    const auto type = object.find("type");
    if (type == object.end() || !type->is_string()) fail(at, "has no member 'type'");
    return type->get<std::string>();
  }

  const Json& member(const Json& object, const char* name, const std::string& at) const {
    const auto found = object.find(name);
    if (found == object.end() || !found->is_array()) {
      fail(at, fmt::format("has no list '{}'", name));
    }
    return *found;
  }

  void add_feature(const Json& feature, const std::string& at) {
    if (type_of(feature, at) != "Feature") fail(at, "is not a Feature");
    const auto geometry = feature.find("geometry");
    if (geometry == feature.end()) fail(at, "has no member 'geometry'");
    if (geometry->is_null()) return;
    const std::string where = prefix(at) + "geometry";
    add_geometry(*geometry, type_of(*geometry, where), where);
  }

  void add_geometry(const Json& geometry, const std::string& type, const std::string& at) {
    if (type != "Polygon" && type != "MultiPolygon") {
      fail(at, fmt::format("is a '{}', not an area", type));
    }
    const Json& coordinates = member(geometry, "coordinates", at);
    const std::string where = prefix(at) + "coordinates";
    if (type == "Polygon") return add_polygon(coordinates, where);
    for (std::size_t i = 0; i < coordinates.size(); ++i) {
      add_polygon(coordinates[i], fmt::format("{}[{}]", where, i));
    }
  }

  void add_polygon(const Json& rings, const std::string& at) {
    if (!rings.is_array() || rings.empty()) fail(at, "is not a list of rings");
    for (std::size_t i = 0; i < rings.size(); ++i) add_ring(rings[i], fmt::format("{}[{}]", at, i));
  }

  void add_ring(const Json& positions, const std::string& at) {
    if (!positions.is_array()) fail(at, "is not a ring");
    std::vector<Point> ring;
    for (std::size_t i = 0; i < positions.size(); ++i) {
      const Json& p = positions[i];
      const bool pair = p.is_array() && p.size() >= 2 && p[0].is_number() && p[1].is_number();
      if (!pair) fail(fmt::format("{}[{}]", at, i), "is not a pair of numbers");
      ring.push_back({p[0].get<double>(), p[1].get<double>()});
      if (std::fabs(ring.back().x_m) <= kMaxCoordinate_m && std::fabs(ring.back().y_m) <= kMaxCoordinate_m) {
        continue;
      }
      fail(fmt::format("{}[{}]", at, i), "lies beyond 4e9 m");
    }
    if (ring.size() > 1 && ring.front() == ring.back()) ring.pop_back();
    if (ring.size() < 3) fail(at, "has fewer than 3 corners");
    polygon_.rings.push_back(std::move(ring));
  }

  const std::string& path_;
  Polygon polygon_;
};

}  // namespace

Polygon parse_geojson(const std::string& text, const std::string& path) {
  Json document;
  try {
    document = Json::parse(text);
  } catch (const Json::parse_error& error) {
    throw Error(ErrorCode::kForeign, fmt::format("'{}' is not JSON: it goes wrong at byte {}", path,
                                                 error.byte > 0 ? error.byte - 1 : 0))
        .hint(kHint)
        .at(path, error.byte > 0 ? error.byte - 1 : 0);
  } catch (const Json::exception&) {
    throw Error(ErrorCode::kForeign, fmt::format("'{}' holds a number that is out of range", path))
        .hint(kHint)
        .at(path);
  }
  Areas areas(path);
  areas.add(document, "");
  return areas.take();
}

Polygon read_geojson(const std::string& path) {
  const auto refuse = [&] {
    throw Error(ErrorCode::kUnreadable, fmt::format("cannot read '{}': {}", path, std::strerror(errno)))
        .at(path);
  };
  const int fd = path == "-" ? ::dup(STDIN_FILENO) : ::open(path.c_str(), O_RDONLY | O_CLOEXEC);
  const std::unique_ptr<std::FILE, int (*)(std::FILE*)> file(fd < 0 ? nullptr : ::fdopen(fd, "rb"),
                                                             std::fclose);
  if (file == nullptr) refuse();
  std::string text;
  std::vector<char> buffer(std::size_t{1} << 16);
  for (std::size_t got = 0; (got = std::fread(buffer.data(), 1, buffer.size(), file.get())) > 0;) {
    text.append(buffer.data(), got);
    if (text.size() > kMaxFileBytes) {
      throw Error(ErrorCode::kLimit, fmt::format("'{}' is larger than 64 MiB", path)).at(path);
    }
  }
  if (std::ferror(file.get()) != 0) refuse();
  return parse_geojson(text, path);
}

}  // namespace apgm::tools
