#pragma once

#include <string>

#include "converters/common/converter.hpp"
#include "tools/common/json.hpp"

namespace apgm::tools {

constexpr const char* kApgm = "apgm";

/// The converter of a name that a user gave with `option`; nullptr for .apgm itself.
/// @throws Error{kInvalidArgument} on a name that none reads, or none writes
const converters::Converter* format_named(const std::string& option, const std::string& name, bool reading);

/// The name of a format, nullptr being .apgm.
std::string format_name(const converters::Converter* converter);

/// By the extension, nullptr for .apgm. @throws Error{kInvalidArgument} if the extension says nothing
const converters::Converter* format_of_output(const std::string& path);

struct InputFormat {
  const converters::Converter* converter = nullptr;  ///< nullptr: .apgm, or a stream
  bool is_stream = false;
};

/// By the content. It is .apgm also for what is called so: the reader then says what is wrong.
/// @throws Error{kUnreadable|kForeign|kUnsupported}
InputFormat format_of_input(const std::string& path);

/// What --formats tells: names, extensions, settings and losses of all formats.
Json formats_json();
/// The same for people.
std::string formats_text(const Json& formats);

}  // namespace apgm::tools
