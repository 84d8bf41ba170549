/// A recording that another program wrote again gives the same messages, samples and model, or a
/// message and an exit code. So does one that changes while it is read.

#include "rewritten_recording.hpp"

#include <gmock/gmock.h>

#include <filesystem>
#include <map>
#include <string>
#include <vector>

#include "abbe/replay/replay.hpp"
#include "abbe_command.hpp"
#include "synthetic_otf_recording.hpp"

namespace abbe::daemon {
namespace {

using test::Rewrite;
using ::testing::HasSubstr;

const std::map<std::string, Rewrite>& rewrites() {
  static const std::map<std::string, Rewrite> all{
      {"as it was", {}},
      {"no chunk indexes", {.chunk_indexes = false}},
      {"no message indexes", {.message_indexes = false}},
      {"channels not repeated", {.channels_in_summary = false}},
      {"channels in chunks only",
       {.channels_in_front = false, .channels_in_chunks = true, .channels_in_summary = false}},
      {"channels in the summary only", {.channels_in_front = false}},
      {"no metadata indexes", {.metadata_indexes = false}},
      {"no attachment indexes", {.attachment_indexes = false}},
      {"no statistics", {.statistics = false}},
      {"only statistics",
       {.chunk_indexes = false,
        .channels_in_summary = false,
        .metadata_indexes = false,
        .attachment_indexes = false}},
      {"no summary", {.summary = false}},
      {"no chunks", {.chunks = false}},
      {"no chunks and no summary", {.summary = false, .chunks = false}},
      {"records of later versions", {.unknown_records = true}},
      {"records of later versions, no summary", {.summary = false, .unknown_records = true}}};
  return all;
}

std::vector<std::string> messages_of(const RecordingReader& reader) {
  std::vector<std::string> all;
  for (auto cursor = reader.messages(); const auto message = cursor.next();) {
    const auto* data = reinterpret_cast<const char*>(message->payload.data());
    all.push_back(std::string(message->topic) +
                  std::to_string(message->taken.time_since_epoch().count()) +
                  std::string(data, message->payload.size()));
  }
  return all;
}

TEST(RewrittenRecording, HasTheSameMessagesAndAttachments) {
  const TemporaryFolder folder;
  const auto original = example_recording(folder.path(), 3, 10);
  const auto wanted = messages_of(*RecordingReader::open(original));
  ASSERT_EQ(wanted.size(), 30u);
  for (const auto& [what, how] : rewrites()) {
    const auto file = folder.path() / "again.mcap";
    test::rewrite(original, file, how);
    const auto reader = RecordingReader::open(file);
    ASSERT_TRUE(reader) << what << ": " << reader.error().text;
    EXPECT_EQ(messages_of(*reader), wanted) << what;
    EXPECT_TRUE(reader->losses().empty()) << what << ": " << reader->losses().front().what;
    EXPECT_TRUE(reader->closed_cleanly()) << what;
    EXPECT_EQ(reader->configuration_check(), MetadataCheck::Right) << what;
    EXPECT_TRUE(reader->intact()) << what;
  }
}

TEST(RewrittenRecording, GivesTheSameModel) {
  const TemporaryFolder folder;
  const auto original = test::record_synthetic_run(folder.path());
  const auto model_of = [](const std::filesystem::path& file) {
    const auto reader = RecordingReader::open(file);
    const auto config = recorded_config(*reader, file.string());
    const auto report = replay(*reader, *config, {});
    return report && !report->calibrations.empty() ? report->calibrations[0].model_hash : "";
  };
  const std::string wanted = model_of(original);
  ASSERT_FALSE(wanted.empty());
  for (const Rewrite& how :
       {Rewrite{.chunk_indexes = false},
        Rewrite{.metadata_indexes = false, .attachment_indexes = false},
        Rewrite{.channels_in_front = false, .channels_in_chunks = true, .summary = false},
        Rewrite{.summary = false, .chunks = false}}) {
    test::rewrite(original, folder.path() / "again.mcap", how);
    EXPECT_EQ(model_of(folder.path() / "again.mcap"), wanted);
  }
}

TEST(RewrittenRecording, ThatIsCompressedIsRefusedWithTheNameOfTheCompression) {
  const TemporaryFolder folder;
  const auto original = example_recording(folder.path(), 2, 10);
  for (const std::string compression : {"zstd", "lz4"}) {
    test::rewrite(original, folder.path() / "again.mcap", {.compression = compression});
    const auto ran = test::run_abbe(folder.path(), "replay again.mcap");
    EXPECT_EQ(ran.exit, 3);
    EXPECT_THAT(ran.err, HasSubstr("compressed with " + compression + ", which is not supported"));
  }
}

TEST(RewrittenRecording, WithoutTheDescriptionOfAChannelIsDamaged) {
  const TemporaryFolder folder;
  test::rewrite(example_recording(folder.path(), 2, 10), folder.path() / "again.mcap",
                {.channels_in_front = false, .channels_in_summary = false});
  const auto reader = RecordingReader::open(folder.path() / "again.mcap");
  ASSERT_TRUE(reader);
  EXPECT_THAT(reader->damage(), HasSubstr("is not described: its messages are skipped"));
}

TEST(RewrittenRecording, WithFewerMessagesThanItsStatisticsCountIsDamaged) {
  const TemporaryFolder folder;
  const auto original = example_recording(folder.path(), 2, 10);
  // the chunks of one recording under the statistics of another
  const auto file = folder.path() / "again.mcap";
  test::rewrite(original, file, {.chunk_indexes = false});
  FileBytes bytes = bytes_of_file(file);
  // the statistics are the last record before the footer; message_count is their first field
  protocol::mcap::Buffer statistics;
  append(statistics, protocol::mcap::Statistics{});
  const std::size_t at = bytes.size() - protocol::mcap::kLeastTail - statistics.size() +
                         protocol::mcap::kRecordHeadSize;
  ASSERT_EQ(bytes[at], 20);
  bytes[at] = 21;
  write_file(file, bytes, bytes.size());
  EXPECT_THAT(RecordingReader::open(file)->damage(),
              HasSubstr("20 messages found, but the statistics of the file count 21"));
}

TEST(ReplayOfNothing, IsNotASuccess) {
  const TemporaryFolder folder;
  RecorderOptions options = example_options(folder.path());
  auto recorder = Recorder::open(
      options, {.machine = "mill", .configuration = test::synthetic_recorded_toml()}, {});
  ASSERT_TRUE(recorder);
  recorder->record(example_event(0));
  ASSERT_TRUE(recorder->close());
  const auto ran = test::run_abbe(folder.path(), "replay run.mcap");
  EXPECT_EQ(ran.exit, 1);
  EXPECT_THAT(ran.out, HasSubstr("no snapshot in 1 messages and 0 samples"));
  EXPECT_EQ(test::run_abbe(folder.path(), "replay run.mcap --samples").exit, 1);
}

class ShrinkingRecording : public ::testing::Test {
 protected:
  ShrinkingRecording() : file_(test::record_synthetic_run(folder_.path())) {}
  void shrink() { std::filesystem::resize_file(file_, std::filesystem::file_size(file_) / 3); }
  TemporaryFolder folder_;
  std::filesystem::path file_;
};

TEST_F(ShrinkingRecording, EndsTheCursorWithAnError) {
  const auto reader = RecordingReader::open(file_);
  ASSERT_TRUE(reader);
  auto cursor = reader->messages();
  ASSERT_TRUE(cursor.next());
  shrink();
  std::uint64_t read = 1;
  while (cursor.next()) ++read;
  EXPECT_LT(read, reader->message_count());
  ASSERT_FALSE(reader->intact());
  EXPECT_EQ(reader->intact().error().code, ErrorCode::Io);
  EXPECT_THAT(reader->intact().error().text, HasSubstr("became shorter while it was read"));
}

TEST_F(ShrinkingRecording, GivesNoModel) {
  const auto reader = RecordingReader::open(file_);
  const auto config = recorded_config(*reader, file_.string());
  shrink();
  for (const auto source : {ReplaySource::Samples, ReplaySource::RawBytes}) {
    const auto report = replay(*reader, *config, {.source = source});
    ASSERT_FALSE(report);
    EXPECT_THAT(report.error().text, HasSubstr("became shorter"));
  }
}

TEST_F(ShrinkingRecording, ThatIsOverwrittenIsAnError) {
  const auto reader = RecordingReader::open(file_);
  const auto size = std::filesystem::file_size(file_);
  shrink();
  std::filesystem::resize_file(file_, size);  // zeros
  std::uint64_t read = 0;
  for (auto cursor = reader->messages(); cursor.next();) ++read;
  EXPECT_LT(read, reader->message_count());
  EXPECT_THAT(reader->intact().error().text, HasSubstr("changed while it was read"));
}

}  // namespace
}  // namespace abbe::daemon
