// Recordings that a killed recorder left open are closed as it would have closed them.

#include "abbe/recording/left_recordings.hpp"

#include <gmock/gmock.h>
#include <sys/wait.h>
#include <unistd.h>

#include <algorithm>
#include <csignal>
#include <fstream>
#include <span>

#include "abbe/protocol/mcap/reader.hpp"
#include "recording_fixture.hpp"

namespace abbe::daemon {
namespace {

namespace fs = std::filesystem;
using ::testing::HasSubstr;
using ::testing::IsEmpty;
using ::testing::SizeIs;

constexpr std::uint32_t kChunks = 3;
constexpr std::uint32_t kPerChunk = 10;

class LeftRecordings : public ::testing::Test {
 protected:
  /// As a recorder of another process leaves it that is killed now: three chunks, an attachment, no
  /// end.
  void leave(const std::string& name) {
    const auto process = ::fork();
    if (process == 0) {
      auto options = example_options(folder_.path());
      options.name = name;
      auto recorder = Recorder::open(options, example_info(), {});
      recorder->attach({"path.csv", "text/csv", "x_mm\n"}, example_time(0));
      for (std::uint32_t i = 0; i < kChunks * kPerChunk; ++i) {
        recorder->record(example_axes(i), "encoder");
        if (i % kPerChunk == kPerChunk - 1) recorder->flush();
      }
      (void)::kill(::getpid(), SIGKILL);
    }

    ASSERT_EQ(::waitpid(process, nullptr, 0), process);
  }
  std::vector<LeftRecording> close(const std::string& running = "abbe-now") {
    auto closed = close_left_recordings(folder_.path(), running, stop_);
    if (!closed) throw std::runtime_error(closed.error().text);
    return std::move(*closed);
  }
  [[nodiscard]] fs::path file(const std::string& name) const { return folder_.path() / name; }
  static RecordingReader read(const fs::path& path) {
    auto reader = RecordingReader::open(path);
    if (!reader) throw std::runtime_error(reader.error().text);
    return std::move(*reader);
  }

  TemporaryFolder folder_;
  std::atomic<bool> stop_{false};
};

TEST_F(LeftRecordings, AreClosedWithIndexAndSummaryAndKeepTheirDate) {
  leave("abbe-1");
  const auto written = fs::file_time_type::clock::now() - std::chrono::hours{48};
  fs::last_write_time(file("abbe-1.mcap.part"), written);
  const auto before = bytes_of_file(file("abbe-1.mcap.part"));
  const auto closed = close();

  ASSERT_THAT(closed, SizeIs(1));
  EXPECT_THAT(closed[0].fault, IsEmpty());
  EXPECT_EQ(closed[0].messages, kChunks * kPerChunk);
  const auto reader = read(file("abbe-1.mcap"));
  EXPECT_TRUE(reader.closed_cleanly());
  EXPECT_THAT(reader.losses(), IsEmpty());
  EXPECT_EQ(reader.message_count(), kChunks * kPerChunk);
  EXPECT_THAT(reader.attachments(), SizeIs(1));
  EXPECT_EQ(fs::last_write_time(file("abbe-1.mcap")), written);
  const auto after = bytes_of_file(file("abbe-1.mcap"));
  EXPECT_TRUE(std::equal(before.begin(), before.end(), after.begin()))
      << "hashes in models still hold";
}

TEST_F(LeftRecordings, AreTheSameAsClosedByTheirRecorder) {
  auto options = example_options(folder_.path());
  options.name = "abbe-closed";
  {
    auto recorder = Recorder::open(options, example_info(), {});
    for (std::uint32_t i = 0; i < 50; ++i) record_example(*recorder, i);
    recorder->flush();
    fs::copy_file(file("abbe-closed.mcap.part"), file("abbe-left.mcap.part"));
  }
  ASSERT_THAT(close(), SizeIs(1));
  EXPECT_EQ(bytes_of_file(file("abbe-left.mcap")), bytes_of_file(file("abbe-closed.mcap")));
}

TEST_F(LeftRecordings, CutAtAnyByteKeepEveryWholeMessage) {
  leave("abbe-1");
  const auto whole = bytes_of_file(file("abbe-1.mcap.part"));
  const std::size_t last_chunks = whole.size() - 4'000;

  for (std::size_t cut = whole.size(); cut > last_chunks; cut -= 7) {
    write_file(file("abbe-cut.mcap.part"), whole, cut);
    const auto messages = read(file("abbe-cut.mcap.part")).message_count();
    fs::rename(file("abbe-1.mcap.part"), file("aside"));
    const auto closed = close();
    fs::rename(file("aside"), file("abbe-1.mcap.part"));
    ASSERT_THAT(closed, SizeIs(1)) << "cut at " << cut;
    ASSERT_THAT(closed[0].fault, IsEmpty()) << "cut at " << cut;
    const auto reader = read(file("abbe-cut.mcap"));
    ASSERT_TRUE(reader.closed_cleanly()) << "cut at " << cut;
    ASSERT_THAT(reader.losses(), IsEmpty()) << "cut at " << cut << ": " << reader.losses()[0].what;
    ASSERT_EQ(reader.message_count(), messages) << "cut at " << cut;
    fs::remove(file("abbe-cut.mcap"));
  }
}

TEST_F(LeftRecordings, WithZerosAtTheEndLoseThem) {
  leave("abbe-1");
  fs::resize_file(file("abbe-1.mcap.part"), fs::file_size(file("abbe-1.mcap.part")) + 5000);
  ASSERT_THAT(close(), SizeIs(1));
  EXPECT_THAT(read(file("abbe-1.mcap")).losses(), IsEmpty());
}

TEST_F(LeftRecordings, WithADamagedMiddleAreKeptAndReported) {
  leave("abbe-1");
  {
    std::ofstream more{file("abbe-1.mcap.part"), std::ios::app | std::ios::binary};
    more << std::string(100, '\0') << "something";
  }
  const auto closed = close();
  ASSERT_THAT(closed, SizeIs(1));
  EXPECT_THAT(closed[0].fault, HasSubstr("damaged at byte"));
  EXPECT_TRUE(fs::exists(file("abbe-1.mcap.part")));
}

/// A flipped bit makes a record of the middle longer than the rest of the file: that is no torn
/// end.
TEST_F(LeftRecordings, WithADamagedLengthInTheMiddleLoseNothing) {
  leave("abbe-1");
  const auto whole = bytes_of_file(file("abbe-1.mcap.part"));
  fs::remove(file("abbe-1.mcap.part"));
  std::vector<std::size_t> heads;  // of all records but those of the last chunk
  std::size_t last_chunk = 0;
  protocol::mcap::LinearScan scan{std::as_bytes(std::span{whole})};

  while (const auto item = scan.next()) {
    heads.push_back(item->record.offset);
    if (item->chunk) last_chunk = item->record.offset;
  }

  ASSERT_GT(heads.size(), kChunks);
  for (const std::size_t head : heads) {
    if (head >= last_chunk) break;
    auto bytes = whole;
    bytes[head + 1 + 3] = static_cast<char>(bytes[head + 1 + 3] ^ 0x01);  // 16 MiB more
    write_file(file("abbe-1.mcap.part"), bytes, bytes.size());
    const auto closed = close();
    ASSERT_THAT(closed, SizeIs(1)) << "record at " << head;
    EXPECT_THAT(closed[0].fault, HasSubstr("damaged at byte " + std::to_string(head)));
    EXPECT_EQ(bytes_of_file(file("abbe-1.mcap.part")), bytes) << "record at " << head;
    fs::remove(file("abbe-1.mcap.part"));
  }
}

/// What does not move the records behind it is found by the reader: the file is closed, nothing is
/// cut off.
TEST_F(LeftRecordings, WithADamagedChunkAreClosedAndTheReaderReportsIt) {
  leave("abbe-1");
  damage_chunk(file("abbe-1.mcap.part"), 0);
  const auto size = fs::file_size(file("abbe-1.mcap.part"));
  const auto closed = close();
  ASSERT_THAT(closed, SizeIs(1));
  EXPECT_THAT(closed[0].fault, IsEmpty());
  EXPECT_GT(fs::file_size(file("abbe-1.mcap")), size);
  EXPECT_THAT(read(file("abbe-1.mcap")).damage(), HasSubstr("the recording is damaged: chunk 1"));
}

TEST_F(LeftRecordings, ThatAreEmptyAreRemoved) {
  write_file(file("abbe-0.mcap.part"), {}, 0);
  auto options = example_options(folder_.path());
  options.name = "abbe-1";
  {
    const auto recorder = Recorder::open(options, example_info(), {});
    fs::copy_file(file("abbe-1.mcap.part"), file("abbe-2.mcap.part"));
    fs::resize_file(file("abbe-2.mcap.part"), 100);
  }
  EXPECT_THAT(close(), SizeIs(2));
  EXPECT_TRUE(fs::is_empty(folder_.path()));
}

TEST_F(LeftRecordings, OfThisRunAndOfARunningRecorderAreNotChanged) {
  leave("abbe-now");
  auto options = example_options(folder_.path());
  options.name = "abbe-living";
  auto recorder = Recorder::open(options, example_info(), {});
  record_example(*recorder, 1);
  recorder->flush();
  EXPECT_THAT(close(), IsEmpty());
  EXPECT_TRUE(fs::exists(file("abbe-now.mcap.part")));
  EXPECT_TRUE(fs::exists(file("abbe-living.mcap.part")));
}

TEST_F(LeftRecordings, ThatAreCompleteAreOnlyRenamed) {
  const auto finished = example_recording(folder_.path(), 2, 5);
  const auto bytes = bytes_of_file(finished);
  fs::rename(finished, file("abbe-1.mcap.part"));
  ASSERT_THAT(close(), SizeIs(1));
  EXPECT_EQ(bytes_of_file(file("abbe-1.mcap")), bytes);
}

TEST_F(LeftRecordings, NeverReplaceAFinishedFile) {
  leave("abbe-1");
  write_file(file("abbe-1.mcap"), {'x'}, 1);
  const auto closed = close();
  ASSERT_THAT(closed, SizeIs(1));
  EXPECT_THAT(closed[0].fault, HasSubstr("abbe-1.mcap"));
  EXPECT_EQ(fs::file_size(file("abbe-1.mcap")), 1u);
}

}  // namespace
}  // namespace abbe::daemon
