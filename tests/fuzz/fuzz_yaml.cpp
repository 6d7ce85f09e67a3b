// Models, profiles and plans of layouts: the YAML texts that people write.

#include "apgm/layouts/nonuniform_grid.hpp"
#include "apgm/observe/model.hpp"
#include "apgm/observe/profile.hpp"
#include "fuzz.hpp"

int LLVMFuzzerTestOneInput(const std::uint8_t* data, std::size_t size) {
  using namespace apgm;
  const auto text = fuzz::text_of(data, size);
  fuzz::survives([&] { parse_models(text, "input.yaml"); });
  fuzz::survives([&] { parse_plan(text, "input.yaml"); });
  fuzz::survives([&] {
    const Schedule schedule = parse_profiles(text, "input.yaml");
    const TypeTable types({LayerType::occupancy(), LayerType::semantic("semantics", {"Road", "Marking"})});
    for (const auto& entry : schedule.entries) {
      entry.profile.check(Frame{}, types);
      ProfileInFrame(entry.profile, Frame{}).required_step({3, -2}, "occupancy", {10, 20});
    }
  });
  return 0;
}
