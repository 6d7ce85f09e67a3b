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
    files_.push_back(
        {std::move(name), std::move(refused), std::move(rule), std::move(bytes), only_by_verification});
  }
  std::vector<BadFile> take() { return std::move(files_); }

 private:
  std::vector<BadFile> files_;
};

void add_structure(BadFiles& out);
void add_map_headers(BadFiles& out);
void add_indices(BadFiles& out);
void add_layers(BadFiles& out);

}  // namespace apgm::test
