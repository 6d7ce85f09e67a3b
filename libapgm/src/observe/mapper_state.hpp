#pragma once

#include <chrono>
#include <unordered_map>

#include "apgm/observe/mapper.hpp"
#include "observe/live_map.hpp"
#include "observe/upkeep.hpp"

namespace apgm {

/// Every layer is in one of three places: in memory, at rest in the store, or nowhere. What rests keeps the
/// tick it was aged to, and is aged, dropped or resampled when it comes back, so that it makes no difference
/// when or why it left.
struct Mapper::State {
  State(const Frame& frame, const Models& models, const MapperOptions& options, PatchStore* store);

  /// Adds the time from its construction to its end to a sum.
  class Stopwatch {
   public:
    explicit Stopwatch(double& seconds) : seconds_(seconds) {}
    ~Stopwatch() { seconds_ += std::chrono::duration<double>(Clock::now() - start_).count(); }
    Stopwatch(const Stopwatch&) = delete;
    Stopwatch& operator=(const Stopwatch&) = delete;

   private:
    using Clock = std::chrono::steady_clock;
    double& seconds_;
    Clock::time_point start_ = Clock::now();
  };

  /// A layer to be fused into the map.
  struct Measured {
    PatchIndex patch;
    TypeId type = 0;  ///< in the map
    const Layer* cells = nullptr;
    const LayerType* cells_type = nullptr;  ///< its policy governs resampling
    RowRange rows;
    float alpha = 1;
  };

  // A call: begin_call, work, end_call (mapper.cpp).
  void begin_call(std::optional<std::int64_t> stamp_ns);
  MapperReport end_call();
  void check_ready(float alpha) const;
  template <typename Measurement>
  MapperReport observe(const Measurement& measurement, TypeId type, const LayerType& cells_type, float alpha);
  void add_types(const TypeTable& types);
  void set_types(const TypeTable& types);
  const Layer& prepared(const Measured& measured, int step, RowRange& rows);
  void fuse(const Measured& measured);

  // Time and requirements (mapper_upkeep.cpp).
  void advance(std::int64_t stamp_ns);
  void age_all(std::int64_t ticks);
  std::optional<int> required(PatchIndex index, TypeId type);
  void follow();
  void fit_to_requirements();
  void fit(PatchIndex index, TypeId type, int step);
  void floor_unknown(PatchIndex index, TypeId type);
  void bring_wanted_back();

  // Traffic with the store (mapper_store.cpp).
  void bring_back(PatchIndex index);
  void rest(PatchIndex index, const std::vector<TypeId>& types);
  void put_to_rest(Patch& patch);
  Patch take_from_rest(PatchIndex index);
  void evict(std::optional<PatchIndex> in_hand = {});
  std::uint64_t layer_bytes(TypeId type, int step) const;
  void check_room(std::uint64_t more_bytes) const;
  void flush();

  Frame frame;
  MapperOptions options;
  PatchStore* store;
  Observer observer;
  LayerType occupancy_type, semantic_type;  ///< of single measurements
  TypeId occupancy = 0, semantics = 0;
  observe::Ageing ageing;
  observe::LiveMap live;
  int base_step = 0;

  std::optional<ProfileInFrame> profile;
  std::string profile_name;
  std::optional<Point> vehicle;
  bool follows = true;  ///< the map is as the profile and the position want it
  std::vector<std::unordered_map<std::uint64_t, std::optional<int>>> steps;  ///< r_req by type and patch

  std::optional<std::int64_t> now_ns;
  std::int64_t tick = 0;
  std::uint64_t calls = 0;
  MapperReport report;

  struct Resting {
    PatchIndex index;
    std::int64_t tick = 0;  ///< that its layers are aged to
    std::vector<TypeId> types;
  };
  std::map<std::uint64_t, Resting> resting;  ///< by curve_key

  Layer resampled, trusted;  // measurements on their way into the map
};

}  // namespace apgm
