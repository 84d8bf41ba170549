// A disk that is full. The limit of the process's file size (RLIMIT_FSIZE) stands for it: the
// kernel writes up to the limit, then refuses with EFBIG, as it does with ENOSPC on a full disk.

#include <gtest/gtest.h>
#include <sys/resource.h>

#include <csignal>
#include <limits>

#include "recording_fixture.hpp"

namespace abbe::daemon {
namespace {

using namespace std::chrono_literals;
using State = RecorderStatus::State;
using WallTime = Recorder::WallTime;

/// No file of this process may grow beyond `bytes` while this object exists.
class FileSizeLimit {
 public:
  explicit FileSizeLimit(rlim_t bytes) {
    before_handler_ = std::signal(SIGXFSZ, SIG_IGN);
    ::getrlimit(RLIMIT_FSIZE, &before_);
    set(bytes);
  }
  FileSizeLimit(const FileSizeLimit&) = delete;
  FileSizeLimit& operator=(const FileSizeLimit&) = delete;
  ~FileSizeLimit() {
    ::setrlimit(RLIMIT_FSIZE, &before_);
    std::signal(SIGXFSZ, before_handler_);
  }
  void set(rlim_t bytes) {
    const rlimit limit{bytes, before_.rlim_max};
    if (::setrlimit(RLIMIT_FSIZE, &limit) != 0) ADD_FAILURE() << "setrlimit";
  }

 private:
  rlimit before_{};
  void (*before_handler_)(int) = nullptr;
};

class DiskFull : public ::testing::Test {
 protected:
  Recorder open(WallTime now = {}) {
    auto options = example_options(folder_.path());
    options.chunk_bytes = 8 * 1024;
    options.watermark = {};  // a further file repeats only the newest sample of the environment
    auto recorder = Recorder::open(options, example_info(), now);
    if (!recorder) throw std::runtime_error(recorder.error().text);
    return std::move(*recorder);
  }
  void record(Recorder& recorder, std::uint32_t messages) {
    for (std::uint32_t i = 0; i < messages; ++i) record_example(recorder, next_++);
  }
  /// Messages in a file that must be whole in itself.
  std::uint64_t sound_messages(std::string_view name, bool closed) {
    const auto reader = RecordingReader::open(folder_.path() / name);
    if (!reader) {
      ADD_FAILURE() << reader.error().text;
      return 0;
    }
    EXPECT_TRUE(reader->losses().empty()) << reader->losses()[0].what;
    EXPECT_EQ(reader->closed_cleanly(), closed);
    return reader->message_count();
  }

  TemporaryFolder folder_;
  std::uint32_t next_ = 0;
};

// About 67 kB of schemas stand at the front of a file, so at 95 kB it has a few chunks.
constexpr rlim_t kFewChunks = 95'000;

TEST_F(DiskFull, AcquisitionContinuesAndTheFaultIsReported) {
  FileSizeLimit limit{kFewChunks};
  Recorder recorder = open();
  record(recorder, 1000);
  EXPECT_EQ(recorder.status().state, State::DiskFull);
  EXPECT_EQ(name(recorder.status().state), "disk full");
  EXPECT_NE(recorder.status().fault.find("run.mcap.part: File too large"), std::string::npos)
      << recorder.status().fault;
  EXPECT_GT(recorder.status().chunks, 0u);
  EXPECT_EQ(recorder.status().messages + recorder.status().lost, 1000u);
}

TEST_F(DiskFull, WhatWasFinishedIsWholeAndNothingIsCorrupt) {
  FileSizeLimit limit{kFewChunks};
  Recorder recorder = open();
  record(recorder, 1000);
  const bool closed = std::filesystem::exists(folder_.path() / "run.mcap");
  EXPECT_EQ(sound_messages(closed ? "run.mcap" : "run.mcap.part", closed),
            recorder.status().messages);
}

TEST_F(DiskFull, EveryLimitWithinAChunkLeavesASoundFile) {
  for (rlim_t bytes = 85'000; bytes < 85'000 + 9'000; bytes += 331) {
    const TemporaryFolder folder;
    auto options = example_options(folder.path());
    options.chunk_bytes = 8 * 1024;
    const FileSizeLimit limit{bytes};
    auto recorder = Recorder::open(options, example_info(), {});
    ASSERT_TRUE(recorder);
    for (std::uint32_t i = 0; i < 600; ++i) record_example(*recorder, i);
    ASSERT_EQ(recorder->status().state, State::DiskFull);
    const auto reader = RecordingReader::open(recorder->status().file);
    ASSERT_TRUE(reader) << reader.error().text;
    EXPECT_TRUE(reader->losses().empty()) << reader->losses()[0].what;
    EXPECT_EQ(reader->message_count(), recorder->status().messages) << "limit " << bytes;
  }
}

TEST_F(DiskFull, RecordingGoesOnInANewFileWhenThereIsRoomAgain) {
  FileSizeLimit limit{kFewChunks};
  Recorder recorder = open(WallTime{100s});
  recorder.attach({"path.csv", "text/csv", "x_mm\n"}, example_time(0));
  record(recorder, 1000);

  ASSERT_EQ(recorder.status().state, State::DiskFull);
  const auto before = recorder.status();
  limit.set(RLIM_INFINITY);
  recorder.tick(WallTime{100s + 4s});
  EXPECT_EQ(recorder.status().state, State::DiskFull) << "not before its time";
  recorder.tick(WallTime{100s + 5s});
  EXPECT_EQ(recorder.status().state, State::Recording);
  EXPECT_TRUE(recorder.status().fault.empty());
  record(recorder, 50);
  const auto closed = recorder.close();
  ASSERT_TRUE(closed) << closed.error().text;
  EXPECT_EQ(closed->file.filename(), "run-2.mcap");
  EXPECT_EQ(sound_messages("run.mcap", true), before.messages);
  EXPECT_EQ(sound_messages("run-2.mcap", true), 50u + 1u) << "with the weather of before";
  const auto second = RecordingReader::open(closed->file);
  EXPECT_EQ(second->metadata().at("abbe.recording").at("part"), "2");
  EXPECT_EQ(second->metadata().at("abbe.recording").at("follows").find("run.mcap"), 0u);
  EXPECT_EQ(second->attachments().size(), 1u + 1u)
      << "every file explains itself, with what is known of axes";
}

TEST_F(DiskFull, TheNextFileStatesHowManyMessagesAreMissing) {
  FileSizeLimit limit{kFewChunks};
  Recorder recorder = open(WallTime{100s});
  constexpr std::uint32_t kHandedOver = 2000;
  for (std::uint32_t i = 0; i < kHandedOver; ++i) recorder.record(example_axes(i), "encoder");
  ASSERT_EQ(recorder.status().state, State::DiskFull);
  const auto before = recorder.status();
  EXPECT_EQ(before.messages + before.lost, kHandedOver);
  limit.set(RLIM_INFINITY);
  recorder.tick(WallTime{105s});
  recorder.record(example_axes(kHandedOver), "encoder");
  recorder.record(example_axes(kHandedOver + 1), "encoder");
  ASSERT_TRUE(recorder.close());
  std::vector<std::uint32_t> lost_before;
  RecordingSink sink;

  sink.axis_sample = [&](const protocol::AxisSample& a, std::string_view) {
    lost_before.push_back(a.head.lost_before);
  };

  EXPECT_EQ(RecordingReader::open(folder_.path() / "run-2.mcap")->read(sink), 0u);
  EXPECT_EQ(lost_before, (std::vector<std::uint32_t>{static_cast<std::uint32_t>(before.lost), 0}));
}

TEST_F(DiskFull, LossesThatALostMessageReportedAreAmongTheMissing) {
  FileSizeLimit limit{kFewChunks};
  Recorder recorder = open(WallTime{100s});
  while (recorder.status().state != State::DiskFull) recorder.record(example_axes(1), "encoder");
  const auto before = recorder.status().lost;

  protocol::AxisSample after_a_loss = example_axes(2);
  after_a_loss.head.lost_before = 7;
  recorder.record(after_a_loss, "encoder");
  limit.set(RLIM_INFINITY);
  recorder.tick(WallTime{105s});
  recorder.record(example_axes(3), "encoder");
  ASSERT_TRUE(recorder.close());

  std::vector<std::uint64_t> lost_before;
  RecordingSink sink;
  sink.axis_sample = [&](const protocol::AxisSample& a, std::string_view) {
    lost_before.push_back(a.head.lost_before);
  };
  EXPECT_EQ(RecordingReader::open(folder_.path() / "run-2.mcap")->read(sink), 0u);
  EXPECT_EQ(lost_before, std::vector<std::uint64_t>{before + 1 + 7});
}

TEST_F(DiskFull, WhileItStaysFullNoPartialFilesAccumulate) {
  FileSizeLimit limit{kFewChunks};
  Recorder recorder = open(WallTime{100s});
  record(recorder, 1000);
  limit.set(1000);
  for (int s = 1; s < 60; ++s) {
    recorder.tick(WallTime{100s + std::chrono::seconds{s}});
    record(recorder, 10);
  }
  EXPECT_EQ(recorder.status().state, State::DiskFull);
  const auto files = std::distance(std::filesystem::directory_iterator{folder_.path()}, {});
  EXPECT_EQ(files, 1);
  EXPECT_EQ(recorder.status().messages + recorder.status().lost, next_);
}

TEST_F(DiskFull, AtTheStartIsNoError) {
  FileSizeLimit limit{1000};
  Recorder recorder = open(WallTime{100s});
  EXPECT_EQ(recorder.status().state, State::DiskFull);
  record(recorder, 10);
  EXPECT_EQ(recorder.status().lost, 10u);
  limit.set(RLIM_INFINITY);
  recorder.tick(WallTime{105s});
  record(recorder, 10);
  ASSERT_TRUE(recorder.close());
  EXPECT_EQ(sound_messages("run.mcap", true), 10u + 1u) << "with the weather of before";
}

TEST_F(DiskFull, LessThanTheRequiredFreeSpaceCountsAsFull) {
  auto options = example_options(folder_.path());
  options.min_free_bytes = std::numeric_limits<std::uint64_t>::max() / 2;
  const auto recorder = Recorder::open(options, example_info(), {});
  ASSERT_TRUE(recorder);
  EXPECT_EQ(recorder->status().state, State::DiskFull);
}

TEST_F(DiskFull, ClosingReportsAnIncompleteRecording) {
  FileSizeLimit limit{kFewChunks};
  Recorder recorder = open();
  record(recorder, 1000);
  const auto closed = recorder.close();
  ASSERT_FALSE(closed);
  EXPECT_EQ(closed.error().code, ErrorCode::Io);
}

}  // namespace
}  // namespace abbe::daemon
