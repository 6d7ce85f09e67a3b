#include "converters/numpy/numpy.hpp"

#include <filesystem>

#include "converters/common/file.hpp"
#include "converters/numpy/export.hpp"
#include "converters/numpy/import.hpp"

namespace apgm::converters {
namespace {

/// The name of the first entry of a ZIP archive, as its local header says it.
std::string_view first_entry(std::string_view head) {
  constexpr std::size_t kHeader = 30, kNameSize = 26;
  using namespace std::string_view_literals;
  if (!head.starts_with("PK\3\4"sv) || head.size() < kHeader) return {};
  const auto byte = [&](std::size_t i) {
    return static_cast<std::size_t>(static_cast<unsigned char>(head[i]));
  };
  return head.substr(kHeader, byte(kNameSize) + 256 * byte(kNameSize + 1));
}

class NumpyConverter final : public Converter {
 public:
  std::string_view name() const override { return "numpy"; }
  std::string_view description() const override {
    return "NumPy arrays: all layers, or .npy and JSON of one";
  }
  std::vector<std::string> extensions() const override { return {".npz", ".npy"}; }

  std::vector<SettingSpec> settings() const override {
    std::vector<SettingSpec> specs{{"step", "resolution step of all arrays, 0..11",
                                    "each its own: an array a layer and step", false, true},
                                   {"compression", ".npz: deflate or none", "deflate", false, true}};
    for (const SettingSpec& spec : frame_settings()) {
      specs.push_back(spec);
      specs.back().default_value = "that of the JSON";
    }
    return specs;
  }

  std::vector<std::string> losses() const override {
    return {"reading float64: values are rounded to float32",
            "writing with step: layers of other steps are split or merged",
            "writing: stamps of layers, metadata and history are left out"};
  }

  bool sniffs(std::string_view /*path*/, std::span<const std::byte> head) const override {
    const std::string_view text(reinterpret_cast<const char*>(head.data()), head.size());
    const std::string_view entry = first_entry(text);
    return text.starts_with("\x93NUMPY") || entry.ends_with(".npy") || entry == "meta.json";
  }
  void check_settings(const Settings& given, Use use) const override {
    const SettingsReader settings(*this, given, use);
    use == Use::kReading ? check_array_import(settings) : check_array_export(settings);
  }
  std::vector<std::string> files_read(const std::string& path) const override {
    std::vector<std::string> files{path};
    std::error_code ignored;
    const bool single = extension_of(path) != ".npz";
    if (single && std::filesystem::exists(json_beside(path), ignored)) files.push_back(json_beside(path));
    return files;
  }
  std::vector<std::string> files_written(const MapHeader& /*header*/,
                                         const WriteRequest& request) const override {
    std::vector<std::string> files{request.path};
    if (extension_of(request.path) == ".npy") files.push_back(json_beside(request.path));
    return files;
  }
  void check_replaceable(const MapHeader& header, const WriteRequest& request) const override {
    std::error_code ignored;
    const std::string side = files_written(header, request).back();
    if (side == request.path || request.output.overwrite || !std::filesystem::exists(side, ignored)) return;
    throw Error(ErrorCode::kOutput, "'" + side + "' already exists")
        .hint("pass --overwrite to replace an array with its JSON")
        .at(side);
  }
  std::unique_ptr<PatchSource> open(const ReadRequest& request) const override {
    return import_arrays(request, SettingsReader(*this, request.settings, Use::kReading));
  }
  void write(const PatchSource& source, const WriteRequest& request) const override {
    export_arrays(source, request, SettingsReader(*this, request.settings, Use::kWriting));
  }
};

}  // namespace

const Converter& numpy() {
  static const NumpyConverter converter;
  return converter;
}

}  // namespace apgm::converters
