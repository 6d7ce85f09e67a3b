#pragma once

#include <string>
#include <utility>
#include <vector>

#include "corpus.hpp"

namespace apgm::test {

/// Collects bad files.
class BadFiles {
 public:
  void add(std::string name, std::string refused, std::string rule, std::string bytes,
           bool only_by_verification = false) {
    add_by(only_by_verification ? "verification" : "reading", std::move(name), std::move(refused),
           std::move(rule), std::move(bytes));
  }
  void add_by(std::string by, std::string name, std::string refused, std::string rule, std::string bytes) {
    files_.push_back({std::move(name), std::move(refused), std::move(rule), std::move(bytes), std::move(by)});
  }
  std::vector<BadFile> take() { return std::move(files_); }

 private:
  std::vector<BadFile> files_;
};

void add_structure(BadFiles& out);
void add_map_headers(BadFiles& out);
void add_indices(BadFiles& out);
void add_layers(BadFiles& out);
/// Archives; a directory of their own.
void add_archives(BadFiles& out);

}  // namespace apgm::test
