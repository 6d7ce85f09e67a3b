#include "tools/common/scratch.hpp"

#include <filesystem>

#include "apgm/core/error.hpp"

namespace apgm::tools {

std::string scratch_directory(const std::string& output) {
  namespace fs = std::filesystem;
  std::error_code error;
  const fs::file_status target = fs::status(output, error);
  if (output != "-" && (!fs::exists(target) || fs::is_regular_file(target))) {
    const fs::path resolved = fs::weakly_canonical(output, error);
    return (error ? fs::path(output) : resolved).parent_path().string();
  }
  const fs::path directory = fs::temp_directory_path(error);
  if (!error) return directory.string();
  throw Error(ErrorCode::kOutput, "there is no directory for temporary files: " + error.message())
      .hint("name one in the environment as TMPDIR");
}

}  // namespace apgm::tools
