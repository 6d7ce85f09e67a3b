#include "corpus.hpp"
#include "small_stream.hpp"
#include "tests/format/archive_support.hpp"

namespace apgm::test {
namespace {

/// A message that leads from one map to the other.
void send_changes(const Map& base, const Map& next, StreamWriter& writer, bool with_ids = true) {
  put_changes(base, next, writer);
  writer.gone(gone_from(base, next));
  writer.end(with_ids ? MessageEnd{content_id_of(base), content_id_of(next)} : MessageEnd{});
}

/// A layer changed, one gone, one new.
Map changed_row() {
  Map map = small_row();
  map.layer({1, 0}, 1, 1).plane(0)[0] = 0.25f;
  map.extract({2, 0}, 1);
  map.layer({-3, 5}, 0, 1).plane(0)[2] = -7;
  return map;
}

std::string changes_after_a_map(const StreamOptions& options = {}) {
  return joined(sent(
      small_row().header(),
      [](StreamWriter& writer) {
        send(small_row(), writer);
        writer.finish();
        send_changes(small_row(), changed_row(), writer);
        send_changes(changed_row(), small_row(), writer);
      },
      options));
}

std::string two_whole_maps() {
  return joined(sent(small_row().header(), [](StreamWriter& writer) {
    send(small_row(4), writer);
    writer.finish();
    send(small_row(2, 0.25f), writer);
    writer.finish();
  }));
}

std::string changes_of_another_map() {
  return joined(sent(small_row().header(),
                     [](StreamWriter& writer) { send_changes(small_row(), changed_row(), writer); }));
}

std::string changes_without_ids() {
  return joined(sent(small_row().header(), [](StreamWriter& writer) {
    send_changes(empty_map(), small_row(), writer, false);
    send_changes(small_row(), changed_row(), writer, false);
  }));
}

std::string gone_alone() {
  return joined(sent(small_row().header(), [](StreamWriter& writer) {
    send(small_row(), writer);
    writer.finish();
    writer.gone(gone_from(small_row(), Map(small_row().header())));
    writer.end({content_id_of(small_row()), content_id_of(Map(small_row().header()))});
  }));
}

/// Of the second message's types one is new, one is no more, one has other channels, one stays under another
/// number.
std::string other_types() {
  MapHeader first, second;
  first.types =
      TypeTable({LayerType::occupancy(), LayerType::real("height", {"z"}), LayerType::real("n", {"a"})});
  second.types =
      TypeTable({LayerType::real("added", {"v"}), LayerType::real("n", {"b"}), LayerType::occupancy()});
  Map map(first), changed(second);
  for (const char* name : {"height", "n", "occupancy"})
    map.layer({3, 4}, *first.types.find(name), 0).plane(0)[0] = 0.5f;
  changed.layer({3, 5}, *second.types.find("added"), 0).plane(0)[0] = 9;
  return joined(sent(first, [&](StreamWriter& writer) {
    send(map, writer);
    writer.finish();
    writer.set_header(second);
    send(changed, writer);
    writer.end({});
  }));
}

std::string another_frame() {
  MapHeader header = small_row().header();
  header.frame.frame_id = "odom";
  Map map(header);
  map.layer({9, 9}, 0, 0).plane(0)[0] = 2;
  return joined(sent(small_row().header(), [&](StreamWriter& writer) {
    send(small_row(), writer);
    writer.finish();
    writer.set_header(header);
    send(map, writer);
    writer.end({});
  }));
}

/// Cells without a pattern: layers of some KiB.
Map large_layers(int patches, int step) {
  Map map(small_row().header());
  Random random(3);
  for (int x = 0; x < patches; ++x) {
    for (float& value : map.layer({x, -x}, 1, step).plane(0)) value = static_cast<float>(random.unit());
  }
  return map;
}

/// Blocks of three kinds that nobody knows.
std::string private_blocks() {
  Texts blocks = sent_map(small_row());
  const std::uint64_t at = head_of(blocks[2]).commit;
  renumber(blocks, 3, 3);
  blocks.insert(blocks.begin() + 3,
                {block_like(blocks[1], 0x80, at + 1, "whatever"), block_like(blocks[1], 0xff, at + 2, ""),
                 block_like(blocks[1], 100, at + 3, std::string(300, 'l'))});
  return joined(blocks);
}

std::string without_preamble(std::uint32_t session) {
  Texts blocks = sent_map(small_row(), {.session = session});
  blocks.erase(blocks.begin());
  return joined(blocks);
}

std::string two_streams() { return joined(sent_map(small_row(2))) + joined(sent_map(small_row(4, 0.125f))); }

}  // namespace

std::vector<StreamFile> good_streams() {
  const Map large = large_layers(2, 3);
  return {
      {"whole_map", "10: a message holds a whole map", joined(sent_map(small_row()))},
      {"whole_map_sample", "10: any map", joined(sent_map(sample_map(5, 4, 4)))},
      {"empty_map", "10: a message holds a whole map", joined(sent_map(small_row(0)))},
      {"whole_map_lossy", "4: encodings with an error bound", joined(sent_map(large, {.lossy = Lossy::kU8}))},
      {"changes_with_gone", "10.2: layers that are gone", changes_after_a_map()},
      {"changes_within_an_mtu", "10.3: parts", changes_after_a_map({.mtu_bytes = 256})},
      {"changes_of_another_map", "10.4: the content id tells", changes_of_another_map()},
      {"changes_without_ids", "10.4: zero, not said", changes_without_ids()},
      {"gone_alone", "10.2: layers that are gone", gone_alone()},
      {"two_whole_maps", "10.4: a layer that a whole map does not hold", two_whole_maps()},
      {"other_types", "10.1: a header with other types", other_types()},
      {"another_frame", "10.1: a header of another frame", another_frame()},
      {"split_into_parts", "10.3: parts", joined(sent_map(large, {.mtu_bytes = 300}))},
      {"header_repeated", "10.1: the MapHeader is repeated",
       joined(sent_map(large_layers(10, 5), {.header_every_bytes = 1}))},
      {"private_blocks", "10.5: kinds that are not known are skipped", private_blocks()},
      {"without_preamble", "10.1: datagrams need no preamble", without_preamble(0)},
      {"session", "10.1: bytes 36..39", without_preamble(0x80000001)},
      {"two_streams", "10.1: in a pipe a preamble begins a new stream", two_streams()}};
}

}  // namespace apgm::test
