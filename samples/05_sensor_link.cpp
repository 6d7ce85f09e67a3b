// Decentralised fusion: sensor modules, each a process with a map of its own, send the layers that change to
// a central unit over links of limited rate; there the copies are fused.
//
//   05_sensor_link OUTPUT.apgm [BYTES_PER_SECOND]     (the fused map; the limit of each link, 200000)

#include <sys/wait.h>
#include <unistd.h>

#include <cerrno>
#include <cstdio>
#include <cstdlib>
#include <cstring>
#include <exception>
#include <memory>
#include <optional>
#include <system_error>
#include <thread>
#include <vector>

#include "apgm/format/content_id.hpp"
#include "apgm/format/stream.hpp"
#include "apgm/format/writer.hpp"
#include "apgm/fuse/map_fuser.hpp"
#include "apgm/observe/mapper.hpp"
#include "apgm/ops/copy.hpp"
#include "support/hall.hpp"
#include "support/link.hpp"

namespace {

constexpr int kModules = 2;
constexpr int kSteps = 12;
constexpr std::uint32_t kMtuBytes = 1400;

/// A laser that looks ahead (module 0) or back (1), on a robot that drives through a hall.
apgm::LaserScan scan_of(int module, int step) {
  constexpr double kPi = 3.141592653589793;
  return apgm::samples::scan_of_the_hall({10.0 + 3 * step, 9.0}, step * 1'000'000'000LL,
                                         (module == 0 ? -0.6 : 0.4) * kPi, 432);  // both see the sides
}

/// The map of one module as it drives.
class Module {
 public:
  explicit Module(int number) : number_(number), mapper_(apgm::Frame{}, models_) {}
  void drive(int step) {
    apgm::Skipped skipped;
    mapper_.add(apgm::to_range_scan(scan_of(number_, step), models_.limits, skipped));
  }
  apgm::Mapper& mapper() { return mapper_; }

 private:
  int number_;
  apgm::Models models_;  // the defaults: a laser after Nuss et al.
  apgm::Mapper mapper_;
};

/// A sensor module's process: what changed goes out after every step.
void run_module(int number, std::uint16_t port, double bytes_per_s) {
  const wire::Socket socket = wire::Socket::connected_to(port);
  wire::RateLimit limit(bytes_per_s);
  Module module(number);
  const apgm::Map& map = module.mapper().map();
  apgm::StreamWriter writer(
      [&](std::span<const std::byte> block) {
        limit.take(block.size());
        socket.send(block);
      },
      map.header(), {.mtu_bytes = kMtuBytes});
  for (int step = 0; step < kSteps; ++step) {
    module.drive(step);
    const apgm::MapChanges changes = module.mapper().take_changes();
    apgm::copy(changes.changed, map.header().types, writer, /*reencode=*/false);
    writer.gone(changes.gone);
    writer.end({.base = "", .result = apgm::content_id_of(map)});
  }
}

/// The central unit's copy of a module's map.
class Copy final : public apgm::StreamHandler {
 public:
  void header(const apgm::MapHeader& header) override {
    if (map_) {
      map_->set_types(header.types);
    } else {
      map_.emplace(header);
    }
  }
  void layer(const apgm::StreamLayer& layer) override {
    apgm::decode(layer, map_->patch(layer.info.patch).layers[layer.info.type]);
  }
  void gone(const apgm::StreamGone& gone) override { map_->extract(gone.patch, gone.type); }
  void end(const apgm::StreamEnd& end) override {
    if (end.missing == 0 && end.ids.result == apgm::content_id_of(*map_)) ++equal_;
  }
  const apgm::Map& map() const { return *map_; }
  /// Messages after which it was the map of the module.
  int equal() const { return equal_; }

 private:
  std::optional<apgm::Map> map_;
  int equal_ = 0;
};

/// Takes what a module sends until it is done. @return false if anything was lost
bool receive(const wire::Socket& socket, Copy& copy, apgm::StreamReport& report) {
  apgm::StreamReader reader(copy);
  std::vector<std::byte> buffer(1 << 16);
  while (const std::size_t got = socket.receive(buffer)) reader.feed(std::span(buffer).first(got));
  reader.finish();
  report = reader.report();
  return report.complete() && copy.equal() == kSteps;
}

apgm::Map fuse(const std::vector<const apgm::Map*>& maps) {
  apgm::MapFuser fuser;
  fuser.fuse(maps);
  return fuser.take();
}

/// The same drive in one process, without a link.
std::string id_without_links() {
  std::vector<std::unique_ptr<Module>> modules;
  std::vector<const apgm::Map*> maps;
  for (int m = 0; m < kModules; ++m) {
    modules.push_back(std::make_unique<Module>(m));
    for (int step = 0; step < kSteps; ++step) modules.back()->drive(step);
    maps.push_back(&modules.back()->mapper().map());
  }
  return apgm::content_id_of(fuse(maps));
}

/// The central unit. @return its exit code
int run_central(const wire::Socket& listener, const char* output) {
  const auto start = std::chrono::steady_clock::now();
  std::vector<Copy> copies(kModules);
  std::vector<apgm::StreamReport> reports(kModules);
  std::vector<char> whole(kModules);
  std::vector<std::thread> links;
  for (std::size_t m = 0; m < kModules; ++m) {
    links.emplace_back([&, m, socket = listener.accept()] {
      try {
        whole[m] = receive(socket, copies[m], reports[m]);
      } catch (const std::exception& e) {
        std::fprintf(stderr, "05_sensor_link: error: %s\n", e.what());
      }
    });
  }
  for (std::thread& link : links) link.join();
  const std::chrono::duration<double> took = std::chrono::steady_clock::now() - start;
  for (std::size_t m = 0; m < kModules; ++m) {
    std::printf("link %zu: %llu bytes in %llu blocks of at most %u bytes, %llu layers in %llu messages\n", m,
                static_cast<unsigned long long>(reports[m].bytes),
                static_cast<unsigned long long>(reports[m].blocks), kMtuBytes,
                static_cast<unsigned long long>(reports[m].layers),
                static_cast<unsigned long long>(reports[m].messages));
    if (!whole[m]) {
      std::fprintf(stderr, "05_sensor_link: error: link %zu lost blocks\n", m);
      return 4;
    }
  }
  std::vector<const apgm::Map*> maps;
  for (const Copy& copy : copies) maps.push_back(&copy.map());
  const apgm::Map fused = fuse(maps);
  apgm::Writer writer(output, fused.header());
  apgm::copy(fused, fused.header().types, writer, /*reencode=*/false);
  writer.finish();
  const bool is_equal = writer.report().content_id == id_without_links();
  std::printf("%.2f s; fused %zu patches, %s to the map fused in one process\n", took.count(), fused.size(),
              is_equal ? "equal" : "NOT EQUAL");
  return is_equal ? 0 : 70;
}

}  // namespace

int main(int argc, char** argv) {
  const double bytes_per_s = argc == 3 ? std::strtod(argv[2], nullptr) : 200'000;
  if (argc < 2 || argc > 3 || !(bytes_per_s >= 1000)) {
    std::fputs("usage: 05_sensor_link OUTPUT.apgm [BYTES_PER_SECOND]   (1000 or more)\n", stderr);
    return 2;
  }
  std::vector<pid_t> modules;
  int code = 70;
  try {
    const wire::Socket listener = wire::Socket::listening();
    const std::uint16_t port = listener.port();
    for (int m = 0; m < kModules; ++m) {
      const pid_t pid = ::fork();
      if (pid < 0) throw std::system_error(errno, std::generic_category(), "fork");
      if (pid == 0) {
        try {
          run_module(m, port, bytes_per_s);
          ::_exit(0);
        } catch (const std::exception& e) {
          std::fprintf(stderr, "05_sensor_link: module %d: error: %s\n", m, e.what());
          ::_exit(70);
        }
      }
      modules.push_back(pid);
    }
    code = run_central(listener, argv[1]);
  } catch (const apgm::Error& e) {
    std::fprintf(stderr, "05_sensor_link: error: %s\n", e.what());
    code = e.code() == apgm::ErrorCode::kOutput ? 5 : 70;
  } catch (const std::exception& e) {
    std::fprintf(stderr, "05_sensor_link: error: %s\n", e.what());
  }
  for (const pid_t module : modules) ::waitpid(module, nullptr, 0);
  return code;
}
