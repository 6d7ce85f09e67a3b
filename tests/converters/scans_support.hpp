#pragma once

#include <bzlib.h>

#include <cstring>
#include <map>
#include <string>
#include <vector>

#include "converters/scans/scan_reader.hpp"
#include "support.hpp"

namespace apgm::converters::testing {

/// All measurements of a request, and what was left out.
struct ReadScans {
  std::vector<Measurement> list;
  std::map<std::string, ScanFault> faults;

  std::uint64_t count(const std::string& key) const {
    const auto it = faults.find(key);
    return it == faults.end() ? 0 : it->second.count;
  }
  const LaserScan& laser(std::size_t i) const { return std::get<LaserScan>(list.at(i)); }
  const PointCloud& cloud(std::size_t i) const { return std::get<PointCloud>(list.at(i)); }
};

inline ReadScans read_scans(const ScanRequest& request) {
  ReadScans read;
  const auto scans = open_scans(request);
  Measurement m;
  std::uint64_t done = 0;
  while (scans->next(m)) {
    read.list.push_back(m);
    EXPECT_GE(scans->bytes_done(), done);
    done = scans->bytes_done();
  }
  EXPECT_FALSE(scans->next(m));
  if (scans->total_bytes() > 0) {
    EXPECT_LE(done, scans->total_bytes());
  }
  for (const ScanFault& fault : scans->faults()) read.faults.emplace(fault.key, fault);
  return read;
}

inline ReadScans read_scans(const std::string& path, const std::string& poses = "") {
  ScanRequest request;
  request.paths = {path};
  request.poses = poses;
  return read_scans(request);
}

/// Line of a log: a front laser at (x, y) with `n` readings of 2 m.
inline std::string flaser(int n, double time, double x = 1, const std::string& reading = "2.0") {
  std::string line = "FLASER " + std::to_string(n);
  for (int i = 0; i < n; ++i) line += " " + reading;
  const std::string place = " " + std::to_string(x) + " 2 0.5";
  const std::string stamp = std::to_string(time);
  return line + place + place + " " + stamp + " host " + stamp + "\n";
}

inline std::string packed(const std::string& bytes) {
  std::string out(bytes.size() + bytes.size() / 100 + 1024, '\0');
  auto size = static_cast<unsigned>(out.size());
  std::string in = bytes;
  EXPECT_EQ(BZ2_bzBuffToBuffCompress(out.data(), &size, in.data(), static_cast<unsigned>(in.size()), 1, 0, 0),
            BZ_OK);
  out.resize(size);
  return out;
}

template <class Value>
std::string raw(const Value& value) {
  return {reinterpret_cast<const char*>(&value), sizeof value};
}

template <class Value, class... More>
std::string raw(const Value& value, const More&... more) {
  return raw(value) + raw(more...);
}

}  // namespace apgm::converters::testing
