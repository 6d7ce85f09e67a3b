#pragma once

#include <cstddef>
#include <cstdint>
#include <functional>
#include <memory>
#include <string>
#include <vector>

#include "apgm/core/source.hpp"
#include "apgm/core/working_memory.hpp"
#include "apgm/format/output_file.hpp"

namespace apgm {

/// How values are kept (docs/format.md, "Encodings").
enum class Lossy : std::uint8_t {
  kNone,  ///< every bit
  kU16,   ///< masses in steps of 1/65535, error at most 1/65535
  kU8,    ///< masses in steps of 1/255, error at most 1/255
};

struct WriterOptions {
  OutputOptions output;
  int level = 3;  ///< zstd, 1..19
  Lossy lossy = Lossy::kNone;
};

struct WriteReport {
  std::string content_id;  ///< 32 hex digits
  std::uint64_t file_bytes = 0;
  std::uint64_t patches = 0;
  std::uint64_t layers = 0;
};

/// Writes a sealed .apgm file: patches in key order, one commit. Memory does not grow with the map.
///
/// Guarantees: same header, options and patches give the same bytes; the file appears whole, in `finish`, or
/// not at all. Thread rule: `pack` from any thread, the rest from one.
class Writer final : public PatchSink, public WorkingMemory {
 public:
  /// @param path    target, or "-" for standard output
  /// @throws Error{kOutput} as OutputFile; {kInvalidArgument|kLimit} on a header that cannot be stored
  Writer(const std::string& path, const MapHeader& header, const WriterOptions& options = {});
  /// To the end of `bytes`, which outlives the writer; they are a whole file after `finish`.
  /// @param options  `output` is not used
  Writer(std::vector<std::byte>& bytes, const MapHeader& header, const WriterOptions& options = {});
  ~Writer() override;

  /// Unless masses are to be rounded: then every layer must come as cells.
  bool takes_stored() const override;
  void pack(Parcel& parcel) const override;
  /// Of the compression, which takes more the higher the level is.
  std::uint64_t working_bytes(std::uint64_t layer_bytes) const override;
  void put(PatchIndex index, std::span<Parcel> parcels) override;
  void finish() override;
  /// After `finish`.
  const WriteReport& report() const;

 private:
  struct State;
  void start(const MapHeader& header, const WriterOptions& options, const std::function<OutputFile()>& open);
  std::unique_ptr<State> state_;
};

}  // namespace apgm
