// Writes the files of the conformance corpus and what is expected of them (docs/conformance.md).
//
//   make-corpus DIR             all of the corpus
//   make-corpus --random N DIR  N random maps, archives and broken streams with the dumps of the library's
//   readers

#include <algorithm>
#include <cstdio>
#include <exception>
#include <filesystem>
#include <fstream>
#include <iterator>
#include <random>
#include <set>
#include <stdexcept>
#include <string>

#include "apgm/format/version.hpp"
#include "bad_files.hpp"
#include "dump.hpp"
#include "random_map.hpp"
#include "small_stream.hpp"
#include "tests/format/archive_support.hpp"
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

void write_json(const fs::path& path, const json& content) { write(path, content.dump(1) + "\n"); }

void write_good(const fs::path& dir) {
  fs::create_directories(dir);
  for (const auto& files : {written_files(), foreign_made_files()}) {
    for (const GoodFile& file : files) {
      const fs::path path = dir / (file.name + ".apgm");
      write(path, file.bytes);
      write_json(dir / (file.name + ".json"), dump(Reader(path.string())));
    }
  }
}

void write_good_archives(const fs::path& dir) {
  fs::create_directories(dir);
  std::vector<GoodFile> files = written_archives();
  std::ranges::move(foreign_made_archives(), std::back_inserter(files));
  for (const GoodFile& file : files) {
    const fs::path path = dir / (file.name + ".apgm");
    write(path, file.bytes);
    try {
      write_json(dir / (file.name + ".json"), dump_archive(path.string()));
    } catch (const std::exception& e) {
      throw std::runtime_error(file.name + ": " + e.what());
    }
  }
}

/// One line a file.
void write_bad(const fs::path& dir, BadFiles files) {
  fs::create_directories(dir);
  std::string lines;
  std::set<std::string> names;
  for (const BadFile& file : files.take()) {
    if (!names.insert(file.name).second) throw std::runtime_error("two files are named " + file.name);
    write(dir / (file.name + ".apgm"), file.bytes);
    const json line{{"refused", file.refused}, {"by", file.by}, {"rule", file.rule}};
    lines += (lines.empty() ? "{\n" : ",\n") + json(file.name).dump() + ": " + line.dump();
  }
  write(dir / "expected.json", lines + "\n}\n");
}

BadFiles bad_files() {
  BadFiles files;
  add_structure(files);
  add_map_headers(files);
  add_indices(files);
  add_layers(files);
  return files;
}

BadFiles bad_archives() {
  BadFiles files;
  add_archives(files);
  return files;
}

/// What the library counts must be what the file says.
void write_streams(const fs::path& dir, const std::vector<StreamFile>& files) {
  fs::create_directories(dir);
  for (const StreamFile& file : files) {
    const fs::path path = dir / (file.name + ".apgms");
    write(path, file.bytes);
    json found = dump_stream(path.string());
    for (const auto& [key, value] : found["counts"].items()) {
      const auto said = file.counts.find(key);
      const std::uint64_t expected = said == file.counts.end() ? 0 : said->second;
      const bool is_fault = key != "blocks" && key != "messages" && key != "layers" && key != "gone";
      if ((is_fault || said != file.counts.end()) && value != expected) {
        throw std::runtime_error(file.name + ": " + key + " is " + value.dump() + ", not " +
                                 std::to_string(expected));
      }
    }
    found["rule"] = file.rule;
    write_json(dir / (file.name + ".json"), found);
  }
}

void write_random_map(std::uint64_t seed, const fs::path& dir) {
  RandomMapOptions options;
  options.range = {{-2, -2}, {1, 1}};
  options.min_step = 0;
  WriterOptions how;
  how.output.overwrite = true;
  how.level = 1 + static_cast<int>(seed % 19);
  how.lossy = static_cast<Lossy>(seed % 3);
  const fs::path path = dir / ("random_" + std::to_string(seed) + ".apgm");
  write_map(random_map(seed, options), path.string(), how);
  write_json(dir / ("random_" + std::to_string(seed) + ".json"), dump(Reader(path.string())));
}

/// Some commits; in every other one a header is replaced, in every third the end is torn, or more.
void write_random_archive(std::uint64_t seed, const fs::path& dir) {
  std::mt19937_64 rng(seed);
  const std::string name = "archive_" + std::to_string(seed);
  const std::string path = (dir / (name + ".apgm")).string();
  fs::remove(path);
  Map map = empty_map();
  for (std::uint64_t i = 0; i < 2 + seed % 4; ++i) {
    const Map next = changed_map(map, rng, i == 0 ? 12 : 3);
    commit_map(path, map, next, {.message = "seed " + std::to_string(seed)});
    map = next;
    if (rng() % 2 == 0) tag_commit(path, "t" + std::to_string(rng() % 3));
  }
  if (seed % 5 == 0) compact_archive(path, {.keep = 1});
  const std::string bytes = read_file(path);
  if (seed % 3 == 0) write(path, bytes + bytes.substr(64, rng() % (bytes.size() - 400)));
  if (seed % 7 == 0) write(path, bytes.substr(0, rng() % bytes.size()));
  write_json(dir / (name + ".json"), result_of_archive(path));
}

/// A map, and changes of it; then what a bad line does to them.
void write_random_stream(std::uint64_t seed, const fs::path& dir) {
  std::mt19937_64 rng(seed);
  Map map = changed_map(empty_map(), rng, 12);
  StreamOptions options;
  options.mtu_bytes = seed % 2 == 0 ? 256 : 0;
  Texts blocks = sent(
      map.header(),
      [&](StreamWriter& writer) {
        send(map, writer);
        writer.finish();
        for (int i = 0; i < 3; ++i) {
          const Map next = changed_map(map, rng, 3);
          if (next.header().types != map.header().types) continue;
          put_changes(map, next, writer);
          writer.gone(gone_from(map, next));
          writer.end({content_id_of(map), content_id_of(next)});
          map = next;
        }
      },
      options);
  for (std::uint64_t faults = seed % 4; faults > 0; --faults) {
    const std::size_t i = 1 + rng() % (blocks.size() - 1);
    std::string& block = blocks[i];
    switch (rng() % 4) {
      case 0:
        blocks.erase(blocks.begin() + static_cast<std::ptrdiff_t>(i));
        break;
      case 1:
        block[rng() % block.size()] ^= 1;
        break;
      case 2:
        blocks.insert(blocks.begin() + static_cast<std::ptrdiff_t>(i),
                      blocks[1 + rng() % (blocks.size() - 1)]);
        break;
      default:
        block.erase(rng() % block.size(), 1 + rng() % 20);
    }
    if (blocks.size() < 2) break;
  }
  const std::string name = "stream_" + std::to_string(seed);
  write(dir / (name + ".apgms"), joined(blocks));
  write_json(dir / (name + ".json"), dump_stream((dir / (name + ".apgms")).string()));
}

void write_random(int count, const fs::path& dir) {
  fs::create_directories(dir);
  for (std::uint64_t seed = 0; seed < static_cast<std::uint64_t>(count); ++seed) {
    write_random_map(seed, dir);
    write_random_archive(seed, dir);
    write_random_stream(seed, dir);
  }
}

int run(const std::vector<std::string>& arguments) {
  if (arguments.size() == 3 && arguments[0] == "--random") {
    write_random(std::stoi(arguments[1]), arguments[2]);
  } else if (arguments.size() == 1 && !arguments[0].starts_with('-')) {
    write_good(fs::path(arguments[0]) / "good");
    write_bad(fs::path(arguments[0]) / "bad", bad_files());
    write_good_archives(fs::path(arguments[0]) / "archives" / "good");
    write_bad(fs::path(arguments[0]) / "archives" / "bad", bad_archives());
    write_streams(fs::path(arguments[0]) / "streams" / "good", good_streams());
    write_streams(fs::path(arguments[0]) / "streams" / "lossy", lossy_streams());
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
