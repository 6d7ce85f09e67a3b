#include "converters/numpy/npz_reader.hpp"

#include <zip.h>

#include <filesystem>

#include "apgm/core/error.hpp"
#include "converters/common/settings.hpp"

namespace apgm::converters {

struct NpzReader::State {
  ~State() { zip_discard(archive); }
  zip_t* archive = nullptr;
};

class NpzReader::Entry {
 public:
  Entry(const NpzReader& reader, const std::string& name) : name_(name) {
    zip_t* archive = reader.state_->archive;
    file_ = zip_fopen(archive, name.c_str(), 0);
    if (file_ == nullptr) fail(zip_strerror(archive));
  }
  ~Entry() { zip_fclose(file_); }
  Entry(const Entry&) = delete;
  Entry& operator=(const Entry&) = delete;

  std::size_t read(std::span<std::byte> out) {
    std::size_t got = 0;
    while (got < out.size()) {
      const zip_int64_t n = zip_fread(file_, out.data() + got, out.size() - got);
      if (n < 0) fail(zip_file_strerror(file_));
      if (n == 0) break;
      got += static_cast<std::size_t>(n);
    }
    return got;
  }

 private:
  [[noreturn]] void fail(const char* why) const {
    throw Error(ErrorCode::kDamaged, "entry '" + printable(name_) + "' cannot be read: " + printable(why))
        .hint("the archive is damaged or names an entry it does not hold; 'unzip -t' lists its entries");
  }

  std::string name_;
  zip_file_t* file_ = nullptr;
};

NpzReader::NpzReader(const std::string& path) : path_(path), state_(std::make_unique<State>()) {
  std::error_code ignored;
  if (!std::filesystem::is_regular_file(path, ignored)) {
    throw Error(ErrorCode::kUnreadable, "cannot read '" + path + "': no such file")
        .hint("check the name and the directory")
        .at(path);
  }
  int error = 0;
  state_->archive = zip_open(path.c_str(), ZIP_RDONLY, &error);
  if (state_->archive != nullptr) return;
  zip_error_t described;
  zip_error_init_with_code(&described, error);
  const std::string why = printable(zip_error_strerror(&described));
  zip_error_fini(&described);
  throw Error(ErrorCode::kDamaged, "'" + path + "' is no archive that can be read: " + why)
      .hint("the file is damaged or was cut short; numpy.savez writes such archives")
      .at(path);
}

NpzReader::~NpzReader() = default;

bool NpzReader::has(const std::string& name) const {
  return zip_name_locate(state_->archive, name.c_str(), 0) >= 0;
}

std::string NpzReader::text(const std::string& name, std::uint64_t max_bytes) const {
  Entry entry(*this, name);
  std::string text;
  std::vector<std::byte> chunk(std::size_t{1} << 16);
  for (std::size_t got = 0; (got = entry.read(chunk)) > 0;) {
    if (text.size() + got > max_bytes) {
      throw Error(ErrorCode::kLimit,
                  "entry '" + printable(name) + "' has more than " + std::to_string(max_bytes) + " bytes")
          .hint("it holds frame and layers only; docs/converters.md says which keys");
    }
    text.append(reinterpret_cast<const char*>(chunk.data()), got);
  }
  return text;
}

std::vector<float> NpzReader::array(const std::string& name, std::uint64_t max_bytes, NpyHeader& header,
                                    std::uint64_t& rounded) const {
  Entry entry(*this, name);
  return read_npy([&](std::span<std::byte> out) { return entry.read(out); }, max_bytes, header, rounded);
}

}  // namespace apgm::converters
