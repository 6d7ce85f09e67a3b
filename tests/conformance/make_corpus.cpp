// Writes the files of the conformance corpus and what is expected of them (docs/conformance.md).
//
//   make-corpus DIR             good/ and bad/ of the corpus
//   make-corpus --random N DIR  N random maps with the dumps of the library's reader

#include <cstdio>
#include <exception>
#include <filesystem>
#include <fstream>
#include <set>
#include <stdexcept>
#include <string>

#include "apgm/format/version.hpp"
#include "bad_files.hpp"
#include "dump.hpp"
#include "random_map.hpp"
#include "tests/format/sample_map.hpp"

namespace apgm::test {
namespace {

namespace fs = std::filesystem;
using nlohmann::json;

void write(const fs::path& path, const std::string& bytes) {
  std::ofstream out(path, std::ios::binary);
  out << bytes;
  out.close();
  if (!out) throw std::runtime_error("cannot write " + path.string());
}

void write_good(const fs::path& dir) {
  fs::create_directories(dir);
  for (const auto& files : {written_files(), foreign_made_files()}) {
    for (const GoodFile& file : files) {
      const fs::path path = dir / (file.name + ".apgm");
      write(path, file.bytes);
      write(dir / (file.name + ".json"), dump(Reader(path.string())).dump(1) + "\n");
    }
  }
}

/// One line a file.
void write_bad(const fs::path& dir) {
  fs::create_directories(dir);
  std::string lines;
  std::set<std::string> names;
  BadFiles files;
  add_structure(files);
  add_map_headers(files);
  add_indices(files);
  add_layers(files);
  for (const BadFile& file : files.take()) {
    if (!names.insert(file.name).second) throw std::runtime_error("two files are named " + file.name);
    write(dir / (file.name + ".apgm"), file.bytes);
    const json line{{"refused", file.refused},
                    {"by", file.only_by_verification ? "verification" : "reading"},
                    {"rule", file.rule}};
    lines += (lines.empty() ? "{\n" : ",\n") + json(file.name).dump() + ": " + line.dump();
  }
  write(dir / "expected.json", lines + "\n}\n");
}

void write_random(int count, const fs::path& dir) {
  fs::create_directories(dir);
  for (int seed = 0; seed < count; ++seed) {
    RandomMapOptions options;
    options.range = {{-2, -2}, {1, 1}};
    options.min_step = 0;
    const Map map = random_map(static_cast<std::uint64_t>(seed), options);
    WriterOptions how;
    how.output.overwrite = true;
    how.level = 1 + seed % 19;
    how.lossy = static_cast<Lossy>(seed % 3);
    const fs::path path = dir / ("random_" + std::to_string(seed) + ".apgm");
    write_map(map, path.string(), how);
    write(dir / ("random_" + std::to_string(seed) + ".json"), dump(Reader(path.string())).dump(1) + "\n");
  }
}

int run(const std::vector<std::string>& arguments) {
  if (arguments.size() == 3 && arguments[0] == "--random") {
    write_random(std::stoi(arguments[1]), arguments[2]);
  } else if (arguments.size() == 1 && !arguments[0].starts_with('-')) {
    write_good(fs::path(arguments[0]) / "good");
    write_bad(fs::path(arguments[0]) / "bad");
    // Another zstd compresses to other bytes.
    write(fs::path(arguments[0]) / "zstd_version", versions().zstd + "\n");
  } else {
    std::fputs("usage: make-corpus DIR\n       make-corpus --random N DIR\n", stderr);
    return 1;
  }
  return 0;
}

}  // namespace
}  // namespace apgm::test

int main(int argc, char** argv) {
  try {
    return apgm::test::run({argv + 1, argv + argc});
  } catch (const std::exception& e) {
    std::fprintf(stderr, "make-corpus: %s\n", e.what());
    return 2;
  }
}
