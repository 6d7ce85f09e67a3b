#include "converters/scans/scan_reader.hpp"

#include <algorithm>
#include <filesystem>
#include <optional>
#include <set>

#include "converters/scans/carmen.hpp"
#include "converters/scans/cloud_recording.hpp"
#include "converters/scans/formats.hpp"
#include "converters/scans/scan_graph.hpp"

namespace apgm::converters {
namespace {

namespace fs = std::filesystem;

/// Numbers in names by value: "scan9" before "scan10".
bool natural_less(const std::string& a, const std::string& b) {
  const auto digit = [](char c) { return c >= '0' && c <= '9'; };
  std::size_t i = 0, j = 0;
  while (i < a.size() && j < b.size()) {
    if (!digit(a[i]) || !digit(b[j])) {
      if (a[i] != b[j]) return static_cast<unsigned char>(a[i]) < static_cast<unsigned char>(b[j]);
      ++i, ++j;
      continue;
    }
    const auto number = [&](const std::string& text, std::size_t& at) {
      const std::size_t from = std::min(text.find_first_not_of('0', at), text.size());
      std::size_t end = from;
      while (end < text.size() && digit(text[end])) ++end;
      at = end;
      return text.substr(from, end - from);
    };
    const std::string one = number(a, i), other = number(b, j);
    if (one.size() != other.size()) return one.size() < other.size();
    if (one != other) return one < other;
  }
  if (i < a.size() || j < b.size()) return j < b.size();
  return a < b;
}

std::vector<std::string> clouds_in(const std::string& directory) {
  std::vector<std::string> paths;
  std::error_code error;
  for (fs::directory_iterator it(directory, error), end; !error && it != end; it.increment(error)) {
    const std::string path = it->path().string();
    if (is_cloud_name(path) && it->is_regular_file(error)) paths.push_back(path);
  }
  if (error) {
    throw Error(ErrorCode::kUnreadable, "cannot read the directory '" + directory + "': " + error.message())
        .at(directory);
  }
  if (paths.empty()) {
    throw Error(ErrorCode::kForeign, "directory '" + directory + "' holds no clouds")
        .hint("clouds end in .pcd, .bin, .csv or .xyz")
        .at(directory);
  }
  std::ranges::sort(paths, natural_less);
  return paths;
}

/// One or more inputs that are read as one: a log, a graph, a list, or clouds that stand side by side.
struct Part {
  Format format = Format::kCarmen;
  std::string path;                   // of a log or graph
  std::unique_ptr<ByteStream> bytes;  // already open: standard input
  std::vector<PlacedCloud> clouds;
};

/// Sorts the inputs of a request into parts.
class Plan {
 public:
  Plan(const ScanRequest& request, ScanFaults& faults) : request_(request), faults_(faults) {
    if (!request.format.empty()) format_ = format_named(request.format);
    for (const std::string& path : request.paths) add(path);
    place();
  }

  std::vector<Part> parts;
  std::set<Format> formats;
  std::uint64_t total_bytes = 0;  // 0: not known
  std::vector<std::string> names;
  std::vector<std::string> files;  // names, and the clouds that lists name

 private:
  void add(const std::string& path) {
    std::error_code error;
    if (path != "-" && fs::is_directory(path, error)) {
      for (const std::string& cloud : clouds_in(path)) add_file(cloud, true);
    } else {
      add_file(path, false);
    }
  }

  /// @param of_directory  a cloud list among the clouds of a directory is no cloud
  void add_file(const std::string& path, bool of_directory) {
    auto bytes = std::make_unique<ByteStream>(path, request_.cancel);
    const Format format = format_ ? *format_ : format_of(path, bytes->peek(kHeadBytes));
    if (of_directory && !is_cloud(format)) return;
    names.push_back(path);
    files.push_back(path);
    formats.insert(format);
    unknown_size_ = unknown_size_ || path == "-";
    total_bytes = unknown_size_ ? 0 : total_bytes + bytes->bytes_total();
    if (is_cloud(format) || format == Format::kCloudList) {
      if (path == "-") {
        throw Error(ErrorCode::kUnsupported, "clouds are not read from standard input")
            .hint("pass the file by its name");
      }
      if (format == Format::kCloudList) return add_list(path);
      if (parts.empty() || !is_cloud(parts.back().format)) parts.emplace_back().format = format;
      parts.back().clouds.push_back({path, format, {}, {}});
      return;
    }
    Part& part = parts.emplace_back();
    part.format = format;
    part.path = path;
    if (path == "-") part.bytes = std::move(bytes);
  }

  /// The clouds a list names, beside it.
  void add_list(const std::string& path) {
    const PoseFile list = read_poses(path, faults_);
    Part& part = parts.emplace_back();
    part.format = Format::kCloudList;
    for (const PoseFile::Row& row : list.rows) {
      if (!row.pose) continue;
      const std::string cloud = (fs::path(path).parent_path() / row.name).string();
      files.push_back(cloud);
      ByteStream bytes(cloud);
      const Format format = format_of(cloud, bytes.peek(kHeadBytes));
      if (!is_cloud(format)) {
        throw Error(ErrorCode::kForeign, "'" + cloud + "', named in " + list.place(row) + ", is no cloud")
            .at(cloud);
      }
      total_bytes += unknown_size_ ? 0 : bytes.bytes_total();
      part.clouds.push_back({cloud, format, row.pose, {}});
    }
  }

  void place() {
    std::vector<PlacedCloud*> open;
    bool own_pose = true;
    for (Part& part : parts) {
      if (!is_cloud(part.format)) continue;
      for (PlacedCloud& cloud : part.clouds) {
        open.push_back(&cloud);
        own_pose = own_pose && cloud.format == Format::kPcd;
      }
    }
    if (request_.poses.empty()) {
      if (open.size() <= 1 || own_pose) return;
      throw Error(ErrorCode::kInvalidArgument, std::to_string(open.size()) + " clouds have no poses")
          .hint("pass the file of their poses with --poses");
    }
    if (open.empty()) {
      throw Error(ErrorCode::kInvalidArgument, "poses are for clouds: the inputs have their own")
          .hint("leave --poses out");
    }
    const PoseFile poses = read_poses(request_.poses, faults_);
    std::vector<PlacedCloud> clouds;
    for (const PlacedCloud* cloud : open) clouds.push_back(*cloud);
    place_clouds(poses, clouds, faults_);
    for (std::size_t i = 0; i < open.size(); ++i) *open[i] = clouds[i];
  }

  const ScanRequest& request_;
  ScanFaults& faults_;
  std::optional<Format> format_;
  bool unknown_size_ = false;
};

/// All parts of a request, one after the other.
class Recordings final : public ScanReader {
 public:
  explicit Recordings(const ScanRequest& request) : cancel_(request.cancel) {
    Plan plan(request, faults_);
    parts_ = std::move(plan.parts);
    total_bytes_ = plan.total_bytes;
    names_ = std::move(plan.names);
    files_ = std::move(plan.files);
    for (const Format format : plan.formats) {
      formats_.emplace_back(scan_formats()[static_cast<std::size_t>(format)].name);
    }
  }

  bool next(Measurement& out) override {
    for (;;) {
      if (recording_ == nullptr && !open_next()) return false;
      if (recording_->next(out)) {
        found_ = any_ = true;
        return true;
      }
      if (!found_) faults_.add(Fault::kNoScan, [this] { return parts_[at_ - 1].path; });
      bytes_before_ += recording_->bytes_done();
      recording_.reset();
    }
  }

  std::uint64_t total_bytes() const override { return total_bytes_; }
  std::uint64_t bytes_done() const override {
    return bytes_before_ + (recording_ ? recording_->bytes_done() : 0);
  }
  std::vector<ScanFault> faults() const override { return faults_.list(); }
  std::vector<std::string> formats() const override { return formats_; }
  std::vector<std::string> files() const override { return files_; }

 private:
  /// @return false at the end
  bool open_next() {
    if (at_ == parts_.size()) {
      if (!any_) fail_empty();
      return false;
    }
    Part& part = parts_[at_++];
    found_ = false;
    if (is_cloud(part.format) || part.format == Format::kCloudList) {
      if (part.path.empty()) part.path = part.clouds.empty() ? names_.front() : part.clouds.front().path;
      recording_ = std::make_unique<CloudRecording>(std::move(part.clouds), faults_, cancel_);
      return true;
    }
    auto bytes = part.bytes ? std::move(part.bytes) : std::make_unique<ByteStream>(part.path, cancel_);
    if (part.format == Format::kGraph) {
      recording_ = std::make_unique<ScanGraph>(std::move(bytes), faults_);
    } else {
      recording_ = std::make_unique<CarmenLog>(std::move(bytes), faults_);
    }
    return true;
  }

  [[noreturn]] void fail_empty() const {
    const std::string& name = names_.front();
    std::string why;
    for (const ScanFault& fault : faults_.list()) {
      if (fault.key != "empty_files") why += (why.empty() ? ": " : "; ") + fault.text;
    }
    const std::string what = names_.size() == 1 ? "'" + name + "' holds" : "the inputs hold";
    throw Error(ErrorCode::kDamaged, what + " no scan with a pose that can be used" + why).at(name);
  }

  const std::atomic<bool>* cancel_;
  ScanFaults faults_;
  std::vector<Part> parts_;
  std::vector<std::string> names_, formats_, files_;
  std::size_t at_ = 0;
  std::unique_ptr<Recording> recording_;
  bool found_ = false, any_ = false;
  std::uint64_t total_bytes_ = 0, bytes_before_ = 0;
};

}  // namespace

std::unique_ptr<ScanReader> open_scans(const ScanRequest& request) {
  if (request.paths.empty()) throw Error(ErrorCode::kInvalidArgument, "no scans are named");
  return std::make_unique<Recordings>(request);
}

}  // namespace apgm::converters
