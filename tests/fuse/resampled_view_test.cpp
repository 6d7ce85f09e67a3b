#include "apgm/fuse/resampled_view.hpp"

#include <gtest/gtest.h>

#include <cstring>

#include "apgm/core/error.hpp"
#include "apgm/fuse/resample.hpp"
#include "layers.hpp"

namespace apgm {
namespace {

using test::Random;

std::vector<LayerType> types_of_all_policies() {
  std::vector<LayerType> types;
  for (const Policy policy : {Policy::kExclusive, Policy::kConditional, Policy::kMin, Policy::kProduct,
                              Policy::kMedian, Policy::kDempster, Policy::kMean}) {
    types.push_back(LayerType::occupancy("occupancy", policy));
  }
  types.push_back(LayerType::semantic("surface", {"Road", "Marking", "Blocked"}));
  types.push_back(LayerType::semantic("surface", {"Road", "Marking", "Blocked"}, Policy::kMean));
  for (const Policy policy : {Policy::kMean, Policy::kSum, Policy::kMinimum, Policy::kMaximum}) {
    types.push_back(LayerType::real("velocity", {"x", "y"}, policy));
  }
  return types;
}

Layer sample(const LayerType& type, int step, Random& random) {
  if (type.policy == Policy::kExclusive) return test::random_exclusive(step, random);
  if (type.is_occupancy()) return test::random_occupancy(step, random);
  if (type.is_evidence()) return test::random_semantic(type, step, random);
  return test::random_real(type, step, random);
}

TEST(ResampledView, AnyRowsHaveTheBitsOfResample) {
  Random random(71);
  ResampledView view;  // one object for all: its scratch must carry nothing over
  for (const LayerType& type : types_of_all_policies()) {
    for (const int from : {4, 2}) {
      const Layer in = sample(type, from, random);
      for (int step = 0; step <= 6; ++step) {
        Layer whole;
        resample(in, type, step, whole);
        view.reset(in, type, step);
        const int side = view.side();
        for (int round = 0; round < 6; ++round) {
          const int begin = static_cast<int>(random() % static_cast<unsigned>(side));
          const int end = begin + 1 + static_cast<int>(random() % static_cast<unsigned>(side - begin));
          const auto row = static_cast<std::size_t>(side);
          const std::size_t count = static_cast<std::size_t>(end - begin) * row;
          std::vector<std::vector<float>> planes(static_cast<std::size_t>(in.channels()),
                                                 std::vector<float>(count));
          std::vector<float*> to;
          for (auto& plane : planes) to.push_back(plane.data());
          view.make({begin, end}, to);
          for (std::size_t c = 0; c < planes.size(); ++c) {
            const float* want =
                whole.plane(static_cast<int>(c)).data() + static_cast<std::size_t>(begin) * row;
            ASSERT_EQ(std::memcmp(planes[c].data(), want, count * sizeof(float)), 0)
                << "seed 71, " << to_string(type.policy) << ", " << from << " -> " << step << ", rows "
                << begin << " to " << end;
          }
        }
      }
    }
  }
}

TEST(ResampledView, RefusesStepsOutOfRange) {
  const Layer in(LayerType::occupancy(), 1);
  EXPECT_THROW(ResampledView(in, LayerType::occupancy(), -1), Error);
  EXPECT_THROW(ResampledView(in, LayerType::occupancy(), 12), Error);
}

}  // namespace
}  // namespace apgm
