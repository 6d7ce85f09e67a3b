// Streams of which something is missing or wrong, and what a receiver must count.

#include <algorithm>

#include "bodies.hpp"
#include "corpus.hpp"
#include "small_stream.hpp"

namespace apgm::test {
namespace {

using Counts = std::map<std::string, std::uint64_t>;
using Edit = std::function<void(BlockHead&, std::string& payload)>;

/// Collects streams. All start from this one: preamble, header (number 1), five layers (2 to 6), end (7).
class Streams {
 public:
  const Texts blocks = sent_map(small_row());
  /// The first layer is of type 0, the others of type 1.
  const Texts in_parts = sent_map(small_row(2, 0.5f, 4), {.mtu_bytes = 256});

  void add(const std::string& name, const std::string& rule, std::string bytes, Counts counts) {
    files_.push_back({name, rule, std::move(bytes), std::move(counts)});
  }
  void edit(const std::string& name, const std::string& rule, std::size_t i, const Edit& change,
            Counts counts) {
    Texts changed = blocks;
    changed[i] = edited(blocks[i], change);
    add(name, rule, joined(changed), std::move(counts));
  }
  void change(const std::string& name, const std::string& rule, const std::function<void(Texts&)>& work,
              Counts counts) {
    Texts changed = blocks;
    work(changed);
    add(name, rule, joined(changed), std::move(counts));
  }
  std::vector<StreamFile> take() { return std::move(files_); }

 private:
  std::vector<StreamFile> files_;
};

void drop(Texts& blocks, std::size_t i) { blocks.erase(blocks.begin() + static_cast<std::ptrdiff_t>(i)); }

void insert(Texts& blocks, std::size_t i, const std::string& bytes) {
  blocks.insert(blocks.begin() + static_cast<std::ptrdiff_t>(i), bytes);
}

void add_losses(Streams& out) {
  const std::string lost = "10.5: numbers that are missing are lost blocks";
  out.change("layer_lost", lost, [](Texts& b) { drop(b, 3); }, {{"lost", 1}});
  out.change("two_layers_lost", lost, [](Texts& b) { drop(b, 3), drop(b, 4); }, {{"lost", 2}});
  out.change("end_lost", "10.4: a message has an End", [](Texts& b) { b.pop_back(); }, {});
  out.change("header_lost", "10.1: a Layer is not read under another header", [](Texts& b) { drop(b, 1); },
             {{"lost", 1}, {"without_header", 6}});
  out.change("first_header_lost_then_repeated", "10.1: who missed the header reads on",
             [](Texts& b) {
               const std::string header = b[1];
               drop(b, 1);
               renumber(b, 4, 1);
               insert(b, 4, edited(header, [](BlockHead& h, std::string&) { h.commit = 5; }));
             },
             {{"lost", 1}, {"layers", 5}});
  out.change("preamble_alone", "10: a stream has messages", [](Texts& b) { b.resize(1); }, {});
  out.change("duplicates", "10.5: a number that came before is ignored",
             [](Texts& b) { insert(b, 4, b[2]), insert(b, 2, b[1]), b.push_back(b.back()); },
             {{"duplicate", 3}});
  out.change("reordered", "10.5: whatever the order of arrival", [](Texts& b) { std::swap(b[2], b[5]); }, {});
  out.change("header_after_its_layers", "10.1: blocks may be kept until the header arrives",
             [](Texts& b) { std::rotate(b.begin() + 1, b.begin() + 2, b.begin() + 5); }, {{"layers", 5}});
  const auto with_newer = [&](bool gone) {
    Texts b = out.blocks;
    const std::string newer =
        gone ? block_like(b[1], kGone, 5, u32(1) + u32(0) + std::string("\1\0\0\0\0\0\0\0", 8))
             : edited(b[3], [&](BlockHead& h, std::string&) { h.commit = 5; });
    renumber(b, 5, 1);
    insert(b, 3, newer);
    return b;
  };
  out.add("older_layer_after_newer", "10.5: the state with the greatest number counts",
          joined(with_newer(false)), {{"superseded", 1}, {"layers", 6}});
  out.add("layer_after_its_going", "10.5: the state with the greatest number counts",
          joined(with_newer(true)), {{"superseded", 1}, {"gone", 1}});
  out.change("smaller_session", "10.1: blocks of a smaller session are dropped",
             [](Texts& b) {
               for (std::size_t i = 1; i < b.size(); ++i) {
                 if (i != 4)
                   b[i] = edited(b[i], [](BlockHead& h, std::string& payload) {
                     h.commit |= std::uint64_t{2} << 32;
                     if (h.kind == kEnd) payload[20] = 2;
                   });
               }
             },
             {{"late", 1}, {"lost", 1}});
}

void add_damage(Streams& out) {
  const auto skipped = [&](std::size_t i) { return static_cast<std::uint64_t>(out.blocks[i].size()); };
  const std::string hashes = "10.5: both hashes of every block are checked";
  const auto flipped = [&](const std::string& name, std::size_t i, std::size_t at, Counts counts) {
    out.change(
        name, hashes, [=](Texts& b) { b[i][at] = static_cast<char>(b[i][at] ^ 4); }, std::move(counts));
  };
  flipped("layer_payload_hash", 3, 64 + 20, {{"damaged", 1}, {"lost", 1}, {"skipped_bytes", skipped(3)}});
  flipped("layer_head_hash", 3, 33, {{"lost", 1}, {"skipped_bytes", skipped(3)}});
  flipped("layer_sync_mark", 3, 0, {{"lost", 1}, {"skipped_bytes", skipped(3)}});
  flipped("header_payload_hash", 1, 64 + 20,
          {{"damaged", 1}, {"lost", 1}, {"without_header", 6}, {"skipped_bytes", skipped(1)}});
  flipped("end_payload_hash", 7, 64 + 20, {{"damaged", 1}, {"skipped_bytes", skipped(7)}});
  flipped("preamble_hash", 0, 30, {{"skipped_bytes", 64}});
  const std::string mark = "10.5: it goes on at the next sync mark, at any offset";
  out.change("bytes_between", mark, [](Texts& b) { insert(b, 3, "xAPGMBLK1y"); }, {{"skipped_bytes", 10}});
  out.change("bytes_missing", mark, [](Texts& b) { b[3].erase(70, 11); },
             {{"damaged", 1}, {"lost", 1}, {"skipped_bytes", skipped(3) - 11}});
  out.change("bytes_missing_in_a_head", mark, [](Texts& b) { b[3].erase(20, 5); },
             {{"lost", 1}, {"skipped_bytes", skipped(3) - 5}});
  out.change("cut_in_a_block", mark, [](Texts& b) { b[7].resize(70); },
             {{"damaged", 1}, {"skipped_bytes", 70}});
  out.change("cut_in_a_head", mark, [](Texts& b) { b[7].resize(60); }, {{"skipped_bytes", 60}});
  const auto padded =
      std::ranges::find_if(out.blocks.begin() + 2, out.blocks.end(),
                           [](const std::string& block) { return head_of(block).p % 8 != 0; });
  const auto i = static_cast<std::size_t>(padded - out.blocks.begin());
  out.change("padding", "2.2: the padding is zero", [=](Texts& b) { b.at(i).back() = 1; },
             {{"damaged", 1}, {"lost", 1}, {"skipped_bytes", skipped(i)}});
}

void add_rules(Streams& out) {
  const Counts one{{"damaged", 1}, {"lost", 1}};
  const auto layer = [&](const std::string& name, const std::string& rule, const Edit& change) {
    out.edit("layer_" + name, rule, 4, change, one);
  };
  const auto field = [](auto value, int id) {
    return [=](BlockHead&, std::string& payload) {
      auto& table = *flatbuffers::GetMutableRoot<flatbuffers::Table>(payload.data());
      if (!table.SetField<decltype(value)>(static_cast<flatbuffers::voffset_t>(id), value, 0))
        throw std::runtime_error("a field that is not stored");
    };
  };
  out.edit(
      "number_0", "10.1: numbers start at 1", 3, [](BlockHead& h, std::string&) { h.commit = 0; }, one);
  out.edit(
      "block_of_a_file", "10.1: 3, 4, 5 do not stand in a stream", 3,
      [](BlockHead& h, std::string&) { h.kind = kIndexPage; }, one);
  layer("key", "10.1: key of the patch", [](BlockHead& h, std::string&) { ++h.key; });
  layer("patch", "10.1: key of the patch", field(std::int32_t{3}, fbs::Layer::VT_IX));
  layer("type_unknown", "10.1: type against the header", field(std::uint16_t{2}, fbs::Layer::VT_TYPE));
  layer("step_12", "10.1: step", field(std::uint8_t{12}, fbs::Layer::VT_STEP));
  layer("too_large", "10.1: the block is no larger than section 5 allows",
        [](BlockHead&, std::string& payload) { payload += std::string(20'000, '\0'); });
  layer("flatbuffer_too_large", "4: the FlatBuffer takes at most 4096 bytes",
        [](BlockHead& h, std::string& payload) {
          payload.insert(h.m, 4096, '\0');
          h.m += 4096;
        });
  out.edit("layer_encoding_unknown", "2.4: an encoding that is not known", 4,
           field(std::uint8_t{5}, fbs::Layer::VT_ENCODING), {{"unsupported", 1}, {"lost", 1}});
  out.edit("layer_content_hash", "4: the cells have the content hash", 4,
           field(std::uint64_t{5}, fbs::Layer::VT_CONTENT_HASH), {{"unusable", 1}, {"layers", 5}});
  out.edit("layer_body_cut", "4: the body ends with the last of its fields", 4,
           [](BlockHead&, std::string& payload) { payload.pop_back(); }, {{"unusable", 1}, {"layers", 5}});
  out.edit("header_under_another_hash", "10.1: bytes 48..55 of a MapHeader are its own hash", 1,
           [](BlockHead& h, std::string&) { ++h.reserved; },
           {{"damaged", 1}, {"lost", 1}, {"without_header", 6}});
  out.edit("layer_under_another_header", "10.1: a Layer is not read under another header", 4,
           [](BlockHead& h, std::string&) { ++h.reserved; }, {{"without_header", 1}});
  const std::string end = "10.4: fields of the End";
  const auto end_field = [&](const std::string& name, std::size_t at, char value) {
    out.edit("end_" + name, end, 7, [=](BlockHead&, std::string& payload) { payload[at] = value; },
             {{"damaged", 1}});
  };
  end_field("flags", 24, 2);
  end_field("first_behind_itself", 16, 8);
  end_field("first_0", 16, 0);
  end_field("first_of_another_session", 20, 1);
  out.edit("end_too_short", end, 7, [](BlockHead&, std::string& payload) { payload.resize(56); },
           {{"damaged", 1}});
  out.edit("end_with_flatbuffer", end, 7, [](BlockHead& h, std::string&) { h.m = 8; }, {{"damaged", 1}});

  const auto gone = [&](const std::string& name, const std::string& records, std::uint64_t damaged = 1) {
    out.change(
        "gone_" + name, "10.2: records of Gone",
        [&](Texts& b) {
          renumber(b, 4, 1);
          insert(b, 4, block_like(b[1], kGone, 4, records));
        },
        damaged == 0 ? Counts{{"gone", records.size() / 16}} : one);
  };
  const auto record = [](std::uint32_t x, std::uint32_t y, std::uint32_t type) {
    return u32(x) + u32(y) + u32(type) + u32(0);
  };
  gone("right", record(0, 0, 0) + record(0, 0, 1), 0);
  gone("empty", "");
  gone("cut", record(0, 0, 0).substr(0, 15));
  gone("not_ascending", record(0, 0, 1) + record(0, 0, 0));
  gone("twice", record(0, 0, 1) + record(0, 0, 1));
  gone("type_unknown", record(0, 0, 2));
  gone("reserved", record(0, 0, 1u << 16));
  std::string many;
  for (std::uint32_t x = 0; x < 4097; ++x) many += record(x, 0, 0);
  gone("more_than_4096", many);

  const std::string newer = "10.5: unsupported";
  out.edit("block_version", newer, 3, [](BlockHead& h, std::string&) { h.version = 2; },
           {{"unsupported", 1}, {"lost", 1}, {"skipped_bytes", out.blocks[3].size()}});
  out.edit("block_flag", newer, 3, [](BlockHead& h, std::string&) { h.flags = 2; },
           {{"unsupported", 1}, {"lost", 1}, {"skipped_bytes", out.blocks[3].size()}});
  out.edit("unknown_kind_that_must_be_understood", newer, 3,
           [](BlockHead& h, std::string&) {
             h.kind = 9;
             h.flags = 1;
           },
           {{"unsupported", 1}, {"lost", 1}});
}

void add_parts(Streams& out) {
  const Texts& parts = out.in_parts;
  std::size_t first = 0, last = 0;  // of the last layer
  for (std::size_t i = 2; i < parts.size(); ++i) {
    if (head_of(parts[i]).kind != kPart) continue;
    if (head_of(parts[i - 1]).key != head_of(parts[i]).key || head_of(parts[i - 1]).kind != kPart) first = i;
    last = i;
  }
  const auto add = [&](const std::string& name, const std::string& rule,
                       const std::function<void(Texts&)>& change, Counts counts) {
    Texts b = parts;
    change(b);
    out.add("parts_" + name, rule, joined(b), std::move(counts));
  };
  const std::string all = "10.3: a block whose parts are not all there is not there";
  add("reordered", "10.5: whatever the order of arrival",
      [&](Texts& b) { std::reverse(b.begin() + 2, b.end()); }, {});
  add("twice", "10.5: duplicates", [&](Texts& b) { insert(b, last, b[first]); }, {{"duplicate", 1}});
  add("one_lost", all, [&](Texts& b) { drop(b, first + 1); }, {{"lost", 1}, {"incomplete", 1}});
  add("last_lost", all, [&](Texts& b) { drop(b, last); }, {{"lost", 1}, {"incomplete", 1}});
  add("first_lost", all, [&](Texts& b) { drop(b, first); }, {{"lost", 1}, {"incomplete", 1}});
  const std::string head = "10.3: head of a part";
  const auto edit = [&](const std::string& name, const std::string& rule, const Edit& change, Counts counts) {
    add(
        name, rule, [&](Texts& b) { b[first + 1] = edited(b[first + 1], change); }, std::move(counts));
  };
  const Counts bad{{"damaged", 1}, {"lost", 1}, {"incomplete", 1}};
  edit(
      "piece_beyond", head, [](BlockHead&, std::string& p) { p[1] = 1; }, bad);
  edit(
      "one_alone", head, [](BlockHead&, std::string& p) { p[0] = 0, p[4] = 1; }, bad);
  edit(
      "bytes_not_of_8", head, [](BlockHead&, std::string& p) { p[8] = static_cast<char>(p[8] ^ 4); }, bad);
  edit(
      "bytes_of_the_whole_huge", head, [](BlockHead&, std::string& p) { p[15] = 1; }, bad);
  edit(
      "piece_too_short", "10.3: pieces are of one size",
      [](BlockHead&, std::string& p) { p.resize(p.size() - 8); }, bad);
  edit(
      "no_head", head, [](BlockHead&, std::string& p) { p.resize(8); }, bad);
  edit("whole_fails_its_hash", "10.3: both hashes of the whole block",
       [](BlockHead&, std::string& p) { p.back() = static_cast<char>(p.back() ^ 1); },
       {{"damaged", 1}, {"lost", 1}});
  add("whole_has_another_number", "10.3: the whole has the number of its last part",
      [&](Texts& b) { renumber(b, first, 1); }, {{"damaged", 1}, {"lost", 2}});
}

void add_preambles(Streams& out) {
  const auto preamble = [&](const std::string& name, const std::function<void(Preamble&)>& change) {
    // A file's preamble under the hooks that every file is made with.
    Hooks hooks;
    hooks.preamble = change;
    const std::string bytes = put_together(Parts{}, hooks).substr(0, 64);
    out.change(name, "10.5: a preamble with another incompat bit", [&](Texts& b) { b[0] = bytes; },
               {{"unsupported", out.blocks.size()}});
  };
  preamble("preamble_another_bit", [](Preamble& p) { p.incompat = 3; });
  preamble("preamble_of_a_file", [](Preamble& p) { p.incompat = 0; });
  preamble("preamble_another_version", [](Preamble& p) { p.major = 2, p.incompat = 1; });
  out.add("no_bytes", "10: a stream has messages", "", {});
  out.add("no_stream", "10.5: bytes that are no block", "this is no stream", {{"skipped_bytes", 17}});
}

}  // namespace

std::vector<StreamFile> lossy_streams() {
  Streams out;
  add_losses(out);
  add_damage(out);
  add_rules(out);
  add_parts(out);
  add_preambles(out);
  return out.take();
}

}  // namespace apgm::test
