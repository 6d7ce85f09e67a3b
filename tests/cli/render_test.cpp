#include "cli_test.hpp"

namespace apgm::test {
namespace {

class RenderCliTest : public CliTest {
 protected:
  Outcome render(std::vector<std::string> arguments) const {
    arguments.insert(arguments.end(), {"a.apgm", "-o", "out.png"});
    return tool("render", arguments);
  }
};

TEST_F(RenderCliTest, MemoryThatIsNamedIsEnough) {
  write("a.apgm", plain_map(40, 40));
  for (const char* little : {"3B", "64KiB", "2MiB"}) {
    const Outcome outcome = render({"-O", "--scale", "0.4", "--max-memory", little});
    expect_failure(outcome, 6, "MiB, more than is allowed", "pass --max-memory with at least ");
    const std::string hint = "pass --max-memory with at least ";
    const std::size_t at = outcome.err.find(hint);
    ASSERT_NE(at, std::string::npos);
    const std::size_t from = at + hint.size();
    std::string size = outcome.err.substr(from, outcome.err.find(',', from) - from);
    std::erase(size, ' ');
    expect_silent(render({"-O", "--scale", "0.4", "--max-memory", size}));
  }
}

TEST_F(RenderCliTest, WhichOfSeveralSlicesIsDrawnIsSaid) {
  MapHeader header;
  LayerType low = LayerType::occupancy(), high = LayerType::occupancy();
  low.name = "z0.5";
  high.name = "z1.5";
  header.types = TypeTable({low, high});
  Map map(header);
  for (const TypeId type : {TypeId{0}, TypeId{1}}) map.layer({0, 0}, type, 3).at(0, {1, 1}) = 1.0f;
  write("a.apgm", map);
  const Outcome outcome = render({});
  EXPECT_EQ(outcome.code, 0);
  EXPECT_THAT(
      outcome.err,
      HasSubstr("note: layer 'z0.5' is drawn; the map has 1 other occupancy layer, drawn with --layer"));
  expect_silent(render({"-O", "--layer", "z1.5"}));
}

TEST_F(RenderCliTest, BadColormapListsTheAllowed) {
  write("a.apgm", plain_map(1, 1));
  expect_failure(render({"--colormap", "xyzzy"}), 2, "--colormap takes one of", "allowed: belief, evidence");
}

TEST_F(RenderCliTest, AnExtensionOfAnotherFormatIsWorthAWarning) {
  write("a.apgm", plain_map(1, 1));
  const Outcome outcome = tool("render", {"a.apgm", "-o", "x.jpg"});
  EXPECT_EQ(outcome.code, 0);
  EXPECT_THAT(outcome.err, HasSubstr("'x.jpg' gets .png content whatever its extension says"));
}

}  // namespace
}  // namespace apgm::test
