// The public MCAP libraries read what we write: dates, fields, indexes, checksums.

#include <algorithm>
#include <array>
#include <cmath>

#include "recording_in_public_libraries.hpp"

namespace abbe::daemon {
namespace {

using nlohmann::json;

std::string text(std::int64_t value) {
  return std::to_string(value);
}
std::string host_ns(std::uint32_t i) {
  return text(example_time(i).time_since_epoch().count());
}

/// What each library must see of example `i`, field by field, as verify.mjs prints it.
/// JSON has no NaN: the libraries write null.
template <std::size_t N>
json numbers_or_null(const std::array<double, N>& values) {
  json out = json::array();
  for (const double v : values) out.push_back(std::isnan(v) ? json() : json(v));
  return out;
}

json expected_value(std::uint32_t i) {
  switch (i % 5) {
    case 0: {
      const auto p = example_point(i);
      return {{"device", "tracker"},
              {"host_time_ns", host_ns(i)},
              {"u_time_ns", text(p.head.u_time.count())},
              {"device_time_ns", text(p.device_time.time_since_epoch().count())},
              {"flags", p.head.flags},
              {"lost_before", p.head.lost_before},
              {"device_status", p.device_status},
              {"p_tracker_m", p.p_tracker_m}};
    }
    case 1: {
      const auto a = example_axes(i);
      return {{"device", "encoder"},
              {"host_time_ns", host_ns(i)},
              {"u_time_ns", text(a.head.u_time.count())},
              {"flags", a.head.flags},
              {"lost_before", a.head.lost_before},
              {"cycle", a.cycle},
              {"missing_mask", a.missing_mask},
              {"counts", {text(a.count[0]), text(a.count[1]), text(a.count[2])}},
              {"position", {a.position[0], a.position[1], a.position[2]}}};
    }
    case 2: {
      const auto block = example_block(i);
      json bytes = json::array();
      for (std::size_t b = 0; b < block.length; ++b)
        bytes.push_back(static_cast<int>(block.bytes[b]));
      return {{"device", "tracker"},
              {"host_time_ns", host_ns(i)},
              {"lost_before", block.lost_before},
              {"to_device", block.direction == protocol::RawBlock::Direction::ToDevice},
              {"continued", block.continued},
              {"bytes", bytes}};
    }
    case 3: {
      const auto e = example_environment(i);
      return {{"device", "weather"},
              {"host_time_ns", host_ns(i)},
              {"flags", e.head.flags},
              {"air_temperature_K", e.air_temperature_K},
              {"air_pressure_Pa", e.air_pressure_Pa},
              {"relative_humidity", e.relative_humidity},
              {"measured", e.measured},
              {"temperature_K", numbers_or_null(e.temperature_K)}};
    }
    default:
      return {{"machine", "M1"},      {"host_time_ns", host_ns(i)},          {"method", "otf"},
              {"state", "acquiring"}, {"reason", example_event(i).reason()}, {"progress", 0.5},
              {"model_id", ""}};
  }
}

class RecordingInPublicLibraries : public ::testing::Test {
 protected:
  void SetUp() override {
    if (!PublicLibraries::available()) GTEST_SKIP() << PublicLibraries::kSkipped;
  }
  TemporaryFolder folder_;
};

TEST_F(RecordingInPublicLibraries, EveryFieldOfEveryMessageIsDecodedBySchemaAtTheRightDate) {
  const auto file = example_recording(folder_.path(), 4, 25);
  const json seen = PublicLibraries::verify("whole '" + file.string() + "'");
  const json& messages = seen["indexed"]["messages"];
  ASSERT_EQ(messages.size(), 100u);

  for (std::uint32_t i = 0; i < 100; ++i) {
    ASSERT_EQ(messages[i]["value"], expected_value(i)) << i;
    ASSERT_EQ(messages[i]["sequence"], i / 5);
    ASSERT_EQ(messages[i]["encoding"], "cdr");
    ASSERT_EQ(messages[i]["schemaEncoding"], "omgidl");
  }

  EXPECT_EQ(messages[0]["topic"], "abbe/v1/TrackerPoint");
  EXPECT_EQ(messages[0]["schema"], "abbe::v1::TrackerPoint");
  EXPECT_EQ(messages[0]["date"], "2026-03-01T12:00:00.000Z");
  EXPECT_EQ(messages[99]["date"], "2026-03-01T12:00:00.099Z");
}

TEST_F(RecordingInPublicLibraries, TheStreamIsWholeAndItsChecksumsHold) {
  const auto file = example_recording(folder_.path(), 4, 25);
  const json seen = PublicLibraries::verify("whole '" + file.string() + "'");
  EXPECT_EQ(seen["stream"], (json{{"messages", 100}, {"done", true}}));
  EXPECT_EQ(seen["indexed"]["chunks"], 4);
  EXPECT_EQ(seen["indexed"]["statistics"]["messageCount"], "100");
}

TEST_F(RecordingInPublicLibraries, MetadataAndAttachmentsAreRead) {
  auto recorder = Recorder::open(example_options(folder_.path()), example_info(), {});
  ASSERT_TRUE(recorder);
  recorder->attach({"path.csv", "text/csv", "x_mm,y_mm,z_mm\n"}, example_time(0));
  record_example(*recorder, 0);

  ASSERT_TRUE(recorder->close());
  const json seen =
      PublicLibraries::verify("whole '" + (folder_.path() / "run.mcap").string() + "'");
  const json& metadata = seen["indexed"]["metadata"];
  ASSERT_EQ(metadata.size(), 3u);
  EXPECT_EQ(metadata[0]["name"], "abbe.recording");
  EXPECT_EQ(metadata[0]["entries"]["machine"], "M1");
  EXPECT_EQ(metadata[1]["entries"]["text"], example_info().configuration);
  EXPECT_EQ(
      seen["indexed"]["attachments"],
      (json::array(
          {{{"name", "path.csv"}, {"mediaType", "text/csv"}, {"content", "x_mm,y_mm,z_mm\n"}}})));
}

TEST_F(RecordingInPublicLibraries, AFileCutAtAnyByteStillGivesEveryFinishedChunk) {
  constexpr std::uint32_t kFileChunks = 3;
  constexpr std::uint32_t kMessagesPerChunk = 10;
  const auto file = example_recording(folder_.path(), kFileChunks, kMessagesPerChunk);
  const auto bytes = bytes_of_file(file);
  std::vector<std::size_t> starts;
  std::vector<std::size_t> ends;
  protocol::mcap::LinearScan scan{std::as_bytes(std::span{bytes})};

  while (const auto item = scan.next()) {
    if (!item->chunk) continue;
    starts.push_back(item->record.offset);
    ends.push_back(item->record.end());
  }

  ASSERT_EQ(ends.size(), kFileChunks);
  write_file(folder_.path() / "data.mcap", bytes, scan.whole_until());
  const auto data = (folder_.path() / "data.mcap").string();
  const json seen =
      PublicLibraries::verify("cuts '" + data + "' " + std::to_string(starts[0]) + " 1");
  ASSERT_EQ(seen.size(), scan.whole_until() - starts[0] + 1);

  for (const json& at : seen) {
    const auto finished =
        std::ranges::count_if(ends, [&](std::size_t end) { return end <= at[0]; });
    ASSERT_EQ(at[1], finished * kMessagesPerChunk) << "cut at " << at[0];
  }
}

}  // namespace
}  // namespace abbe::daemon
