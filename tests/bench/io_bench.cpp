// Reading, writing, hashing and verifying a map in one process and on one core, beside memcpy of its planes.

#include <fcntl.h>
#include <sys/stat.h>
#include <unistd.h>

#include <cstddef>
#include <cstring>
#include <string>
#include <vector>

#define XXH_INLINE_ALL
#include <xxhash.h>

#include "apgm/core/error.hpp"
#include "apgm/core/map.hpp"
#include "apgm/format/reader.hpp"
#include "apgm/format/verify.hpp"
#include "apgm/format/writer.hpp"
#include "apgm/ops/copy.hpp"
#include "parcels.hpp"
#include "peer.hpp"
#include "samples/support/program.hpp"

namespace {

using namespace apgm;
using bench::print_timings;
using bench::seconds_of;
using bench::time_runs;
using samples::UsageError;

constexpr const char* kUsage =
    "usage: io-bench read FILE.apgm [--runs N]\n"
    "       io-bench write FILE.apgm OUT.apgm [--runs N] [--lossy u16|u8]\n"
    "       io-bench hash FILE [--runs N]\n"
    "\n"
    "Prints the seconds of each run, one line for each kind of work:\n"
    "  read    read: a file to planes in memory that was there before; stream: to one layer, again and "
    "again;\n"
    "          map: to a new Map; memcpy: of the planes\n"
    "  write   write: layers, one a patch, to a file; memcpy: of the planes\n"
    "  hash    hash: XXH3-64 of the bytes in memory; read_hash: of a file, read in pieces of 1 MiB;\n"
    "          verify: one thread\n";

std::vector<LayerInfo> layers_of(const PatchSource& source) {
  std::vector<LayerInfo> all;
  PatchInfo patch;
  for (const auto cursor = source.patches(); cursor->next(patch);) {
    all.insert(all.end(), patch.layers.begin(), patch.layers.end());
  }
  return all;
}

/// Copies as many bytes as the planes take, between two places that were touched before.
class PlaneCopy {
 public:
  explicit PlaneCopy(std::size_t bytes) : from_(bytes, 1), to_(bytes, 2) {}
  double seconds() {
    return seconds_of([&] {
      std::memcpy(to_.data(), from_.data(), from_.size());
      asm volatile("" : : "r"(to_.data()) : "memory");
    });
  }

 private:
  std::vector<char> from_, to_;
};

std::size_t plane_bytes(const PatchSource& source) {
  std::size_t bytes = 0;
  for (const Summary::OfType& of : source.summary().types) bytes += of.raw_bytes;
  return bytes;
}

void read_kept(const std::string& path, std::vector<Layer>& kept) {
  const Reader reader(path);
  std::size_t at = 0;
  PatchInfo patch;
  for (const auto cursor = reader.patches(); cursor->next(patch);) {
    for (const LayerInfo& info : patch.layers) {
      if (at == kept.size()) kept.emplace_back();
      reader.load(info, kept[at++]);
    }
  }
}

void read_stream(const std::string& path, Layer& layer) {
  const Reader reader(path);
  PatchInfo patch;
  for (const auto cursor = reader.patches(); cursor->next(patch);) {
    for (const LayerInfo& info : patch.layers) reader.load(info, layer);
  }
}

void read_map(const std::string& path, Map& map) {
  const Reader reader(path);
  RunOptions run;
  run.threads = 1;
  MapSink sink(map);
  copy(reader, map.header().types, sink, /*reencode=*/false, run);
  sink.finish();
}

void read(const std::string& path, int runs) {
  const Reader reader(path);
  PlaneCopy planes(plane_bytes(reader));
  std::vector<Layer> kept;
  Layer one;
  std::vector<double> read, stream, map, memcpy;
  for (int i = 0; i <= runs; ++i) {  // the first warms up
    const double t[] = {seconds_of([&] { read_kept(path, kept); }),
                        seconds_of([&] { read_stream(path, one); }), planes.seconds()};
    Map fresh(reader.header());
    const double whole = seconds_of([&] { read_map(path, fresh); });
    if (i == 0) continue;
    read.push_back(t[0]);
    stream.push_back(t[1]);
    memcpy.push_back(t[2]);
    map.push_back(whole);
  }
  print_timings("read", read);
  print_timings("stream", stream);
  print_timings("map", map);
  print_timings("memcpy", memcpy);
}

/// The layers of a map, ready to be written again and again.
std::vector<Parcel> parcels_of(const Reader& reader) {
  std::vector<Parcel> parcels;
  for (const LayerInfo& info : layers_of(reader)) {
    Parcel& parcel = parcels.emplace_back();
    parcel.patch = info.patch;
    parcel.type = info.type;
    reader.load(info, parcel.cells);
  }
  return parcels;
}

void write(const std::string& path, const std::string& output, WriterOptions options, int runs) {
  const Reader reader(path);
  std::vector<Parcel> parcels = parcels_of(reader);
  StoredLayer stored;
  PlaneCopy planes(plane_bytes(reader));
  options.output.overwrite = true;
  std::vector<double> write, memcpy;
  for (int i = 0; i <= runs; ++i) {
    ::unlink(output.c_str());  // so that no run pays for freeing the file of the one before
    const double w = seconds_of([&] {
      Writer writer(output, reader.header(), options);
      bench::write_parcels(writer, parcels, stored);
    });
    const double m = planes.seconds();
    if (i == 0) continue;
    write.push_back(w);
    memcpy.push_back(m);
  }
  print_timings("write", write);
  print_timings("memcpy", memcpy);
}

class InputBytes {
 public:
  explicit InputBytes(const std::string& path) : file_(::open(path.c_str(), O_RDONLY | O_CLOEXEC)) {
    if (file_ < 0) throw Error(ErrorCode::kUnreadable, "cannot open '" + path + "'");
  }
  ~InputBytes() { ::close(file_); }
  InputBytes(const InputBytes&) = delete;
  InputBytes& operator=(const InputBytes&) = delete;
  /// Bytes read, 0 at the end.
  std::size_t read(std::vector<char>& to, std::size_t at, std::size_t most) const {
    const ssize_t n = ::read(file_, to.data() + at, std::min(most, to.size() - at));
    if (n < 0) throw Error(ErrorCode::kUnreadable, "cannot read");
    return static_cast<std::size_t>(n);
  }
  std::size_t size() const {
    struct stat s {};
    if (::fstat(file_, &s) != 0) throw Error(ErrorCode::kUnreadable, "cannot read");
    return static_cast<std::size_t>(s.st_size);
  }

 private:
  int file_;
};

XXH64_hash_t hash_of_file(const std::string& path, std::vector<char>& piece, XXH3_state_t& state) {
  const InputBytes file(path);
  XXH3_64bits_reset(&state);
  while (const std::size_t n = file.read(piece, 0, piece.size())) {
    XXH3_64bits_update(&state, piece.data(), n);
  }
  return XXH3_64bits_digest(&state);
}

void hash(const std::string& path, int runs) {
  const InputBytes file(path);
  std::vector<char> bytes(file.size());
  for (std::size_t at = 0; at < bytes.size();) {
    const std::size_t n = file.read(bytes, at, std::size_t{1} << 30);
    if (n == 0) throw Error(ErrorCode::kUnreadable, "'" + path + "' became shorter");
    at += n;
  }
  std::vector<char> piece(std::size_t{1} << 20);
  XXH3_state_t state;
  XXH3_INITSTATE(&state);
  VerifyOptions options;
  options.threads = 1;
  volatile XXH64_hash_t sink = 0;
  std::vector<double> hash, read_hash, verified;
  for (int i = 0; i <= runs; ++i) {
    const double h = seconds_of([&] { sink = XXH3_64bits(bytes.data(), bytes.size()); });
    const double r = seconds_of([&] { sink = hash_of_file(path, piece, state); });
    const double v = seconds_of([&] {
      if (!verify(path, options).valid()) throw Error(ErrorCode::kDamaged, "'" + path + "' is damaged");
    });
    if (i == 0) continue;
    hash.push_back(h);
    read_hash.push_back(r);
    verified.push_back(v);
  }
  print_timings("hash", hash);
  print_timings("read_hash", read_hash);
  print_timings("verify", verified);
}

void run(std::vector<std::string> args) {
  const int runs = bench::take_runs(args);
  const std::string lossy = samples::take_option(args, "--lossy");
  WriterOptions options;
  if (!lossy.empty()) {
    if (lossy != "u16" && lossy != "u8") throw UsageError{"'" + lossy + "' is not u16 or u8"};
    options.lossy = lossy == "u8" ? Lossy::kU8 : Lossy::kU16;
  }
  const std::string verb = args.empty() ? "" : args[0];
  if (!args.empty()) args.erase(args.begin());
  samples::expect_arguments(args, verb == "write" ? 2 : 1);
  if (verb == "read") return read(args[0], runs);
  if (verb == "write") return write(args[0], args[1], options, runs);
  if (verb == "hash") return hash(args[0], runs);
  throw UsageError{"'" + verb + "' is not read, write or hash"};
}

}  // namespace

int main(int argc, char** argv) { return samples::run_program("io-bench", kUsage, argc, argv, run); }
