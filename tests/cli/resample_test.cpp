#include "cli_test.hpp"

namespace apgm::test {
namespace {

class ResampleCliTest : public CliTest {
 protected:
  void SetUp() override { write("a.apgm", plain_map(4, 4)); }
  /// Resamples a.apgm to out.apgm.
  Outcome resample(std::vector<std::string> arguments) const {
    arguments.insert(arguments.end(), {"a.apgm", "-o", "out.apgm"});
    return tool("resample", arguments);
  }
  Json result(std::vector<std::string> arguments) const {
    arguments.push_back("--json");
    return Json::parse(resample(arguments).out, nullptr, false);
  }
  static const Json& type(const Json& document, const std::string& name) {
    static const Json none;
    for (const Json& type : document["types"]) {
      if (type["name"] == name) return type;
    }
    ADD_FAILURE() << "no type " << name;
    return none;
  }
  /// side x side patches of 2^7 x 2^7 occupied cells. Written patch by patch: the peak memory of a program
  /// starts at what the process that starts it holds.
  void write_noise(const std::string& name, int side) const {
    std::map<std::uint64_t, PatchIndex> patches;
    for (int i = 0; i < side * side; ++i) {
      const PatchIndex patch{i % side, i / side};
      patches[curve_key(patch)] = patch;
    }
    WriterOptions options;
    options.output.overwrite = true;
    const Map empty = empty_map();
    Writer writer(path(name), empty.header(), options);
    Random random(1);
    Parcel parcel;
    for (const auto& [key, patch] : patches) {
      parcel.patch = patch;
      parcel.state = Parcel::State::kCells;
      parcel.cells.reset(empty.header().types[0], 7);
      for (float& o : parcel.cells.plane(0)) o = static_cast<float>(random.below(256)) / 256;
      writer.pack(parcel);
      writer.put(patch, {&parcel, 1});
    }
    writer.finish();
  }
  /// One patch (0,0): an occupied cell among three free ones, at step 1.
  Map obstacle() const {
    Map map = plain_map(0, 0);
    Layer& layer = map.layer({0, 0}, 0, 1);
    layer.plane(0)[0] = 0.9f;
    for (std::size_t i = 1; i < 4; ++i) layer.plane(1)[i] = 0.9f;
    return map;
  }
};

TEST_F(ResampleCliTest, BringsEveryLayerToTheResolution) {
  write_random("a.apgm", 3);
  EXPECT_EQ(resample({"--resolution", "1.6"}).code, 0);
  const Json document = info("out.apgm");
  for (const Json& layer : document["layers"]) {
    ASSERT_EQ(layer["steps"].size(), 1u);
    EXPECT_GT(layer["steps"]["3"], 0);
  }
}

TEST_F(ResampleCliTest, TheSameStepKeepsTheContentId) {
  const Json document = result({"--step", "3"});
  EXPECT_EQ(document["content_id"], info("a.apgm")["map"]["content_id"]);
  EXPECT_EQ(document["layers_stored"], 16);
  EXPECT_EQ(type(document, "occupancy")["layers_unchanged"], 16);
  EXPECT_TRUE(type(document, "occupancy")["loss"].is_null());
}

TEST_F(ResampleCliTest, SameBytesOnAnyThreads) {
  write_random("a.apgm", 7);
  const Json one = result({"-j1", "--step", "2"});
  const std::string bytes_of_one = bytes("out.apgm");
  const Json two = result({"-O", "-j2", "--step", "2"});
  EXPECT_EQ(bytes("out.apgm"), bytes_of_one);
  EXPECT_EQ(two, one);
}

TEST_F(ResampleCliTest, TellsWhatWasLost) {
  write("a.apgm", obstacle());
  const Json occupancy = type(result({"--step", "0"}), "occupancy");
  EXPECT_EQ(occupancy["layers_merged"], 1);
  EXPECT_EQ(occupancy["cells_before"], 4);
  EXPECT_EQ(occupancy["cells_after"], 1);
  EXPECT_EQ(occupancy["obstacles_lost"], 0);
  EXPECT_EQ(occupancy["loss"]["of"], "belief");
  EXPECT_EQ(occupancy["loss"]["known_cells"], 4);
  // Merged: O = .9, F = .1 * .675 = .0675.
  EXPECT_NEAR(occupancy["loss"]["max"], (.9 + .8325) / 2, 1e-6);
  EXPECT_EQ(occupancy["loss"]["worst_layer"]["patch"], Json({0, 0}));
  const Outcome verbose = resample({"-O", "-v", "--step", "0"});
  EXPECT_THAT(verbose.err,
              HasSubstr("note: occupancy: 1 layer merged; 4 cells became 1; belief changed by "));
}

TEST_F(ResampleCliTest, EmptiedLayersAreCountedAndNoted) {
  Map map = plain_map(0, 0);
  map.layer({0, 0}, 0, 1).at(1, {0, 0}) = 0.9f;
  map.layer({1, 0}, 0, 1).at(0, {0, 0}) = 0.9f;
  write("a.apgm", map);
  const std::vector<std::string> arguments{"--step", "0", "--policy", "min"};
  const Outcome outcome = resample(arguments);
  EXPECT_EQ(outcome.code, 0);
  EXPECT_THAT(outcome.err, HasSubstr("note: 1 layer of 'occupancy' comes out without data by policy 'min'"));
  const Json document = result({"-O", "--step", "0", "--policy", "min"});
  EXPECT_EQ(document["patches_emptied"], 1);
  EXPECT_EQ(document["patches_dropped"], 0);
  EXPECT_EQ(document["patches"], 1);
  EXPECT_EQ(type(document, "occupancy")["layers_emptied"], 1);
  EXPECT_EQ(type(document, "occupancy")["cells_after"], 1);
}

TEST_F(ResampleCliTest, TheMapsOwnGridPassesLayersAsStored) {
  write_random("a.apgm", 3);
  const Json before = info("a.apgm")["map"];
  const std::string edge = before["edge_m"].dump();
  const std::string datum = before["datum_m"][0].dump() + "," + before["datum_m"][1].dump();
  const Json document = result({"--edge", edge, "--datum", datum});
  EXPECT_EQ(document["content_id"], before["content_id"]);
  EXPECT_EQ(document["layers_stored"], document["layers"]);
  EXPECT_GT(document["layers"], 0);
}

TEST_F(ResampleCliTest, LostObstaclesAreWarnedOf) {
  write("a.apgm", obstacle());
  const Outcome outcome = resample({"--step", "0", "--policy", "dempster"});
  EXPECT_EQ(outcome.code, 0);
  EXPECT_THAT(outcome.err,
              HasSubstr("apgm-resample: warning: 1 occupied cell of 'occupancy' is no longer occupied"));
  EXPECT_EQ(type(result({"-O", "--step", "0", "--policy", "dempster"}), "occupancy")["obstacles_lost"], 1);
  expect_silent(resample({"-O", "--step", "0", "--policy", "min"}));
}

TEST_F(ResampleCliTest, ThePolicyIsStored) {
  expect_silent(resample({"--step", "2", "--policy", "product"}));
  const Json document = info("out.apgm", {"--history"});
  EXPECT_EQ(document["layers"][0]["policy"], "product");
  EXPECT_EQ(document["history"][0]["parameters"], Json({{"policy", "product"}, {"step", 2}}));
}

TEST_F(ResampleCliTest, OneLayerAlone) {
  write_random("a.apgm", 5);
  const Json document = result({"--step", "0", "--layer", "height"});
  for (const Json& type : document["types"]) {
    EXPECT_EQ(type["layers_merged"] == 0, type["name"] != "height") << type.dump();
  }
  const Json before = info("a.apgm")["layers"], after = info("out.apgm")["layers"];
  ASSERT_EQ(before.size(), after.size());
  for (std::size_t i = 0; i < before.size(); ++i) {
    if (before[i]["name"] == "height") continue;
    EXPECT_EQ(before[i]["name"], after[i]["name"]);
    EXPECT_EQ(before[i]["cells"], after[i]["cells"]);
  }
}

TEST_F(ResampleCliTest, AnotherGrid) {
  expect_silent(resample({"--edge", "6.4"}));
  EXPECT_EQ(info("out.apgm")["map"]["edge_m"], 6.4);
  EXPECT_EQ(info("out.apgm")["map"]["patches"], 64);
  expect_silent(resample({"-O", "--edge", "25.6", "--datum", "-12.8,0", "--resolution", "3.2"}));
  const Json document = info("out.apgm");
  EXPECT_EQ(document["map"]["edge_m"], 25.6);
  EXPECT_EQ(document["map"]["datum_m"], Json({-12.8, 0}));
  EXPECT_EQ(document["layers"][0]["steps"].begin().key(), "3");
}

TEST_F(ResampleCliTest, DryRunTellsThePlan) {
  const Json document = result({"-n", "--step", "1"});
  EXPECT_EQ(document["dry_run"], true);
  EXPECT_EQ(type(document, "occupancy")["layers_merged"], 16);
  EXPECT_EQ(type(document, "occupancy")["cells_after"], 64);
  EXPECT_TRUE(type(document, "occupancy")["loss"].is_null());
  EXPECT_FALSE(exists("out.apgm"));
}

TEST_F(ResampleCliTest, DryRunWithMaxLossMeasures) {
  write("a.apgm", obstacle());
  expect_failure(resample({"-n", "--step", "0", "--max-loss", "none"}), 1,
                 "layer 'occupancy' of patch (0,0) would lose 0.6");
  const Json document = result({"-n", "--step", "0", "--max-loss", "0.7"});
  EXPECT_EQ(document["dry_run"], true);
  EXPECT_EQ(type(document, "occupancy")["loss"]["known_cells"], 4);
  EXPECT_FALSE(exists("out.apgm"));
  EXPECT_THAT(resample({"-n", "-v", "--step", "0"}).err, HasSubstr("the loss was not measured"));
}

TEST_F(ResampleCliTest, MaxLossKeepsTheOldOutput) {
  write("a.apgm", obstacle());
  put("out.apgm", "precious");
  for (const char* bound : {"0.5", "none", "0"}) {
    expect_failure(resample({"-O", "--step", "0", "--max-loss", bound}), 1,
                   "layer 'occupancy' of patch (0,0) would lose 0.6", "nothing was written");
    EXPECT_EQ(bytes("out.apgm"), "precious");
  }
  EXPECT_EQ(files(), (std::set<std::string>{"a.apgm", "out.apgm"}));
  const Json document = result({"-O", "--step", "0", "--max-loss", "0.1"});
  EXPECT_EQ(document["error"]["code"], "no");
  expect_silent(resample({"-O", "--step", "0", "--max-loss", "0.7"}));
  expect_silent(resample({"-O", "--step", "0", "--max-loss", "any"}));
  expect_silent(resample({"-O", "--step", "1", "--max-loss", "none"}));
  expect_silent(resample({"-O", "--step", "4", "--max-loss", "none"}));
}

TEST_F(ResampleCliTest, MaxLossBoundsNumbersOnlyAtNone) {
  MapHeader header;
  header.types = TypeTable({LayerType::real("height", {"z"})});
  Map map(header);
  for (std::size_t i = 0; i < 4; ++i) map.layer({2, -1}, 0, 1).plane(0)[i] = static_cast<float>(100 * i);
  write("a.apgm", map);
  expect_failure(resample({"--step", "0", "--max-loss", "none"}), 1,
                 "layer 'height' of patch (2,-1) would lose");
  expect_silent(resample({"--step", "0", "--max-loss", "0.01"}));
}

TEST_F(ResampleCliTest, ALargerCellThanAPatchIsNoted) {
  const Outcome outcome = resample({"--resolution", "50"});
  EXPECT_EQ(outcome.code, 0);
  EXPECT_EQ(outcome.err, "apgm-resample: note: no cell is larger than a patch: cells of 12.8 m\n");
}

TEST_F(ResampleCliTest, BadArgumentsAreRefusedBeforeTheInputIsRead) {
  const auto refused = [&](std::vector<std::string> arguments, const std::string& message,
                           const std::string& hint = "") {
    arguments.insert(arguments.end(), {"gone.apgm", "-o", "out.apgm"});
    expect_failure(tool("resample", arguments), 2, message, hint);
  };
  refused({}, "there is nothing to resample to", "--resolution, --step");
  refused({"--policy", "min"}, "there is nothing to resample to");
  refused({"--resolution", "1", "--step", "3"}, "--resolution and --step exclude each other");
  refused({"--step", "12"}, "--step takes a whole number from 0 to 11, not '12'");
  refused({"--step", "-1"}, "--step takes a whole number from 0 to 11");
  refused({"--step", "2.5"}, "--step takes a whole number from 0 to 11");
  refused({"--resolution", "nan"}, "--resolution takes a number above 0, not 'nan'");
  refused({"--resolution", "0"}, "--resolution takes a number above 0");
  refused({"--resolution", "-0.1"}, "--resolution takes a number above 0");
  refused({"--step", "2", "--policy", "maen"}, "--policy takes one of", "did you mean 'mean'?");
  refused({"--edge", "0"}, "--edge takes a number from 0.001 to 10000, not '0'");
  refused({"--edge", "nan"}, "--edge takes a number");
  refused({"--edge", "0.0010005"}, "--edge takes whole micrometres");
  refused({"--datum", "5"}, "--datum takes 2 numbers X,Y, not '5'");
  refused({"--datum", "5,6,7"}, "--datum takes 2 numbers X,Y");
  refused({"--datum", "5,x"}, "--datum takes a number");
  refused({"--datum", "2e9,0"}, "--datum takes a number from -1e+09 to 1e+09");
  refused({"--edge", "6.4", "--layer", "occupancy"}, "--layer does not go with --edge");
  refused({"--edge", "6.4", "--max-loss", "0.1"}, "--max-loss does not go with --edge");
  refused({"--step", "2", "--max-loss", "1.5"}, "--max-loss takes a number from 0 to 1");
  refused({"--profile", "p.yaml", "--step", "1"}, "--step and --profile exclude each other");
  refused({"--profile", "p.yaml"}, "--profile needs --at X,Y");
  refused({"--step", "2", "--at", "1,1"}, "--at is for --profile");
  refused({"--step", "2", "--profile-name", "road"}, "--profile-name is for --profile");
  refused({"--profile", "p.yaml", "--at", "1,1", "--edge", "6.4"}, "--profile does not go with --edge");
  refused({"--step", "2", "--max-loss", "some"}, "--max-loss takes", "none");
}

TEST_F(ResampleCliTest, ProfileRoundAPlace) {
  put("near.yaml", R"(name: near
requirements:
  - {layer: occupancy, bands: [{from_m: 0, to_m: 5, cell_m: 0.4}, {from_m: 5, to_m: 14, cell_m: 6.4}]}
)");
  const Outcome outcome = resample({"--profile", "near.yaml", "--at", "6.4,6.4", "--json"});
  EXPECT_EQ(outcome.code, 0);
  EXPECT_THAT(outcome.err,
              HasSubstr("12 layers of 'occupancy' are not required by the profile and left out"));
  const Json document = Json::parse(outcome.out);
  // Round the middle of patch (0,0): its own cells stay (1.6 m, coarser than 0.4 m), neighbours get 6.4 m.
  EXPECT_EQ(document["patches"], 4);
  EXPECT_EQ(document["patches_dropped"], 12);
  const Json occupancy = type(document, "occupancy");
  EXPECT_EQ(occupancy["layers_unchanged"], 1);
  EXPECT_EQ(occupancy["layers_merged"], 3);
  EXPECT_EQ(occupancy["layers_split"], 0);
  EXPECT_EQ(occupancy["layers_dropped"], 12);
  const Json parameters = info("out.apgm", {"--history"})["history"][0]["parameters"];
  EXPECT_EQ(parameters["at_m"], Json({6.4, 6.4}));
  EXPECT_EQ(parameters["profile"]["name"], "near");
  EXPECT_EQ(parameters["profile"]["requirements"][1]["ring_m"], Json({5, 14}));
  expect_failure(resample({"-O", "--profile", "near.yaml", "--at", "6.4,6.4", "--max-loss", "none"}), 1,
                 "patch (");
  const Outcome far = resample({"-O", "-v", "--profile", "near.yaml", "--at", "1e7,0"});
  EXPECT_EQ(far.code, 0);
  EXPECT_THAT(far.err,
              HasSubstr("warning: the profile requires nothing that the map has round (1e+07, 0) m"));
  EXPECT_THAT(far.err, HasSubstr("occupancy: 16 layers left out; nothing of 1 024 cells is kept"));
}

TEST_F(ResampleCliTest, OneOfSeveralProfiles) {
  put("drive.yaml", R"(profiles:
  - {name: parking, requirements: [{layer: occupancy, horizon_m: 1, cell_m: 1.6}]}
  - {name: road, from_s: 9, requirements: [{layer: occupancy, horizon_m: 100, cell_m: 3.2}]}
)");
  const std::vector<std::string> place{"--profile", "drive.yaml", "--at", "6.4,6.4"};
  const auto with = [&](const std::string& name) {
    std::vector<std::string> arguments = place;
    arguments.insert(arguments.end(), {"-q", "-O", "--profile-name", name});
    return resample(arguments);
  };
  expect_failure(resample(place), 2, "'drive.yaml' holds several profiles: parking, road", "--profile-name");
  expect_failure(with("raod"), 2, "'drive.yaml' holds no profile 'raod'", "did you mean 'road'?");
  expect_silent(with("parking"));
  EXPECT_EQ(info("out.apgm")["map"]["patches"], 1);
  expect_silent(with("road"));
  EXPECT_EQ(info("out.apgm")["map"]["patches"], 16);
}

TEST_F(ResampleCliTest, BadProfileIsRefused) {
  const auto refused = [&](const std::string& yaml, int code, const std::string& message) {
    put("p.yaml", yaml);
    expect_failure(resample({"--profile", "p.yaml", "--at", "0,0"}), code, message);
    EXPECT_FALSE(exists("out.apgm"));
  };
  refused("requirements: [{layer: occupancy", 2, "p.yaml");
  refused("requirements: [{layer: ocupancy, horizon_m: 9, cell_m: 0.4}]", 2,
          "'ocupancy' is not one of the map");
  refused("requirements: [{layer: occupancy, horizon_m: 9, cell_m: 0.3}]", 2,
          "no power-of-two part of the edge");
  expect_failure(resample({"--profile", "gone.yaml", "--at", "0,0"}), 4, "'gone.yaml'");
  expect_failure(tool("resample", {"-O", "a.apgm", "--profile", "p.yaml", "--at", "0,0", "-o", "p.yaml"}), 2,
                 "");
}

TEST_F(ResampleCliTest, MemoryDoesNotGrowWithTheMap) {
#if defined(__SANITIZE_ADDRESS__)
  GTEST_SKIP() << "the sanitizer keeps freed memory";
#endif
  const auto peak_mib = [&](int side) {
    write_noise("a.apgm", side);
    const Outcome outcome = resample({"-O", "-v", "-j2", "--step", "6"});
    EXPECT_EQ(outcome.code, 0);
    const std::string label = "peak memory ";
    return std::stod(outcome.err.substr(outcome.err.find(label) + label.size()));
  };
  const double small = peak_mib(9), large = peak_mib(28);  // 10 and 98 MiB of values
  EXPECT_GT(small, 1);
  EXPECT_LT(large, small + 8);
}

TEST_F(ResampleCliTest, WhatDoesNotFitTheMapIsRefused) {
  expect_failure(resample({"--step", "2", "--policy", "sum"}), 2,
                 "the policy 'sum' does not fit layer 'occupancy'", "it takes: exclusive, conditional");
  expect_failure(resample({"--resolution", "0.001"}), 6, "finer than the patch edge / 2^11");
  write("a.apgm", obstacle());
  expect_failure(resample({"--step", "2", "--layer", "occupancy", "--policy", "evidence"}), 2,
                 "does not fit");
  Frame frame;
  frame.edge_um = 1'000'000;
  write("a.apgm", plain_map(1, 1, frame));
  expect_failure(resample({"--edge", "10000"}), 6, "finer than the patch edge / 2^11");
  EXPECT_FALSE(exists("out.apgm"));
}

}  // namespace
}  // namespace apgm::test
