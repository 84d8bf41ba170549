// What a reader still finds in a recording that was cut, overwritten, or whose recorder was killed.

#include <gmock/gmock.h>
#include <sys/wait.h>
#include <unistd.h>

#include <algorithm>
#include <array>
#include <csignal>
#include <filesystem>
#include <fstream>
#include <random>
#include <span>

#include "recording_in_public_libraries.hpp"

namespace abbe::daemon {
namespace {

constexpr std::uint32_t kDamagedChunks = 3;
constexpr std::uint32_t kPerDamagedChunk = 10;

/// 40 kB of schema texts follow the chunks: cuts in them are alike.
constexpr std::size_t kSummaryStep = 17;
constexpr std::size_t kFooterBytes = 200;

std::vector<std::string> texts(std::span<const RecordingLoss> losses) {
  std::vector<std::string> all;
  for (const RecordingLoss& loss : losses) all.push_back(loss.what);
  return all;
}

class DamagedRecording : public ::testing::Test {
 protected:
  DamagedRecording()
      : whole_(bytes_of_file(example_recording(folder_.path(), kDamagedChunks, kPerDamagedChunk))) {
    find_chunks();
  }

  void find_chunks() {
    const auto as_bytes = std::as_bytes(std::span{whole_});
    protocol::mcap::LinearScan scan{as_bytes};
    while (const auto item = scan.next()) {
      if (!item->chunk) continue;
      chunk_starts_.push_back(item->record.offset);
      chunk_ends_.push_back(item->record.end());
    }
  }
  Result<RecordingReader> open(const FileBytes& bytes, std::size_t size) {
    write_file(folder_.path() / "damaged.mcap", bytes, size);
    return RecordingReader::open(folder_.path() / "damaged.mcap");
  }

  TemporaryFolder folder_;
  FileBytes whole_;
  std::vector<std::size_t> chunk_starts_;
  std::vector<std::size_t> chunk_ends_;
};

/// `whole` up to its second chunk, a chunk of 300 MiB (a hole: it needs no space on the disk), the
/// rest of `whole` up to `end`.
std::filesystem::path with_a_large_chunk(const std::filesystem::path& folder,
                                         const FileBytes& whole, std::size_t second_chunk,
                                         std::size_t end) {
  constexpr std::uint64_t kLarge = std::uint64_t{300} << 20;
  const auto file = folder / "large.mcap";
  write_file(file, whole, second_chunk);
  std::fstream out(file, std::ios::binary | std::ios::in | std::ios::out);
  std::array<char, 9> head{6};  // opcode and length
  for (std::size_t i = 0; i < 8; ++i) head[1 + i] = static_cast<char>(kLarge >> (8 * i) & 0xff);
  out.seekp(0, std::ios::end);
  out.write(head.data(), head.size());
  out.seekp(static_cast<std::streamoff>(kLarge), std::ios::cur);
  out.write(&whole[second_chunk], static_cast<std::streamsize>(end - second_chunk));
  out.close();
  if (end == second_chunk)  // it is cut off in the hole
    std::filesystem::resize_file(file, second_chunk + head.size() + kLarge - 1);
  return file;
}

TEST_F(DamagedRecording, ALargeChunkIsALossAndWhatFollowsIsRead) {
  const auto reader = RecordingReader::open(
      with_a_large_chunk(folder_.path(), whole_, chunk_starts_[1], chunk_ends_.back()));
  ASSERT_TRUE(reader) << reader.error().text;
  EXPECT_EQ(reader->message_count(), kDamagedChunks * kPerDamagedChunk);
  EXPECT_THAT(reader->damage(), testing::HasSubstr("is larger than the 256 MiB"));
}

TEST_F(DamagedRecording, ALargeChunkThatIsCutOffIsDamage) {
  const auto reader = RecordingReader::open(
      with_a_large_chunk(folder_.path(), whole_, chunk_starts_[1], chunk_starts_[1]));
  ASSERT_TRUE(reader) << reader.error().text;
  EXPECT_EQ(reader->message_count(), kPerDamagedChunk);
  EXPECT_THAT(reader->damage(), testing::HasSubstr("is larger than the 256 MiB"));
}

TEST_F(DamagedRecording, CutAnywhereKeepsEveryFinishedChunk) {
  ASSERT_EQ(chunk_ends_.size(), kDamagedChunks);
  const auto file = folder_.path() / "cut.mcap";
  write_file(file, whole_, whole_.size());

  // indexes and DataEnd lie behind the last chunk
  const std::size_t data_end = chunk_ends_.back() + 1024;
  const std::size_t footer = whole_.size() - kFooterBytes;
  for (std::size_t cut = whole_.size(); cut >= chunk_starts_[0];
       cut -= cut > data_end && cut < footer ? kSummaryStep : 1) {
    std::filesystem::resize_file(file, cut);
    const auto finished = static_cast<std::uint32_t>(
        std::ranges::count_if(chunk_ends_, [cut](std::size_t end) { return end <= cut; }));
    const auto reader = RecordingReader::open(file);
    ASSERT_TRUE(reader) << "cut at " << cut;
    ASSERT_GE(reader->message_count(), finished * kPerDamagedChunk) << "cut at " << cut;
    ASSERT_LE(reader->message_count(), std::min(finished + 1, kDamagedChunks) * kPerDamagedChunk)
        << "cut at " << cut;
    std::uint32_t i = 0;

    for (auto cursor = reader->messages(); const auto message = cursor.next(); ++i) {
      ASSERT_EQ(message->taken, example_time(i)) << "cut at " << cut;
    }

    ASSERT_EQ(i, reader->message_count());
  }
}

TEST_F(DamagedRecording, CutBeforeItsMetadataEndsIsRefusedWithAMessage) {
  for (std::size_t cut = 0; cut < 100; ++cut) {
    const auto reader = open(whole_, cut);
    ASSERT_FALSE(reader) << cut;
    EXPECT_EQ(reader.error().code, ErrorCode::BadInput);
    EXPECT_NE(reader.error().text.find("damaged.mcap"), std::string::npos);
  }
}

TEST_F(DamagedRecording, CutInsideAChunkGivesItsWholeMessagesAndReportsWhere) {
  const std::size_t cut = (chunk_starts_[1] + chunk_ends_[1]) / 2;
  const auto reader = open(whole_, cut);
  ASSERT_TRUE(reader);
  EXPECT_GT(reader->message_count(), kPerDamagedChunk);
  EXPECT_LT(reader->message_count(), 2 * kPerDamagedChunk);
  EXPECT_FALSE(reader->closed_cleanly());
  ASSERT_EQ(reader->losses().size(), 1u);
  EXPECT_EQ(reader->losses()[0].offset, chunk_starts_[1]);
  const std::string wanted =
      "chunk 2 at byte " + std::to_string(chunk_starts_[1]) + ": cut off by the end of the file";
  EXPECT_EQ(reader->losses()[0].what.find(wanted), 0u) << reader->losses()[0].what;
}

TEST_F(DamagedRecording, AFlippedBitLosesOneChunkAndIsReported) {
  FileBytes flipped = whole_;
  flipped[chunk_ends_[1] - 20] ^= 4;
  const auto reader = open(flipped, flipped.size());
  ASSERT_TRUE(reader);
  EXPECT_EQ(reader->message_count(), (kDamagedChunks - 1) * kPerDamagedChunk);
  EXPECT_TRUE(reader->closed_cleanly());
  EXPECT_EQ(texts(reader->losses()),
            std::vector<std::string>{"chunk 2 at byte " + std::to_string(chunk_starts_[1]) +
                                     ": its checksum is wrong, skipped"});
}

TEST_F(DamagedRecording, ADamagedSummaryLosesNothing) {
  FileBytes flipped = whole_;
  flipped[flipped.size() - 12] ^= 4;
  const auto reader = open(flipped, flipped.size());
  ASSERT_TRUE(reader);
  EXPECT_EQ(reader->message_count(), kDamagedChunks * kPerDamagedChunk);
  ASSERT_EQ(reader->losses().size(), 1u);
  EXPECT_NE(reader->losses()[0].what.find("indexes"), std::string::npos);
}

TEST_F(DamagedRecording, NoSingleDamagedByteLosesMoreThanItsChunkOrConfusesTheReader) {
  std::mt19937 random{20260301};
  std::uniform_int_distribution<std::size_t> anywhere{chunk_starts_[0], whole_.size() - 1};
  for (int round = 0; round < 300; ++round) {
    FileBytes damaged = whole_;
    const std::size_t at = anywhere(random);
    damaged[at] = static_cast<char>(~damaged[at]);
    const auto reader = open(damaged, damaged.size());
    ASSERT_TRUE(reader) << "byte " << at;
    EXPECT_GE(reader->message_count(), (kDamagedChunks - 1) * kPerDamagedChunk) << "byte " << at;
    EXPECT_EQ(reader->read({}), 0u);
  }
}

TEST(RecordingReader, RefusesAFileThatIsNoRecording) {
  const TemporaryFolder folder;
  const auto file = folder.path() / "file";
  write_file(file, {'h', 'e', 'l', 'l', 'o'}, 5);
  EXPECT_EQ(RecordingReader::open(file).error().code, ErrorCode::BadInput);
  write_file(file, {}, 0);
  EXPECT_EQ(RecordingReader::open(file).error().code, ErrorCode::BadInput);
  EXPECT_EQ(RecordingReader::open(folder.path()).error().code, ErrorCode::Io);
  EXPECT_EQ(RecordingReader::open(folder.path() / "missing").error().code, ErrorCode::Io);
}

// --- kill -9 -------------------------------------------------------------------------------------

/// Records samples 0, 1, 2, ... for ever and sends through `pipe` how many are in finished chunks.
[[noreturn]] void record_until_killed(const std::filesystem::path& directory, int pipe) {
  auto options = example_options(directory);
  options.chunk_bytes = 8 * 1024;
  auto recorder = Recorder::open(options, example_info(), {});
  if (!recorder) ::_exit(1);
  std::uint64_t said = 0;
  for (std::uint32_t i = 0;; ++i) {
    record_example(*recorder, i);
    const std::uint64_t written = recorder->status().messages;
    if (written == said) continue;
    said = written;
    if (::write(pipe, &said, sizeof said) != sizeof said) ::_exit(1);
  }
}

/// Kills a recorder after it has finished `chunks` chunks and while it records. Returns the number
/// of messages in finished chunks.
std::uint64_t killed_recorder(const std::filesystem::path& directory, unsigned chunks) {
  int pipe_ends[2];
  if (::pipe(pipe_ends) != 0) return 0;
  const pid_t child = ::fork();
  if (child == 0) {
    ::close(pipe_ends[0]);
    record_until_killed(directory, pipe_ends[1]);
  }
  ::close(pipe_ends[1]);
  std::uint64_t finished = 0;
  for (unsigned k = 0;
       k < chunks && ::read(pipe_ends[0], &finished, sizeof finished) == sizeof finished; ++k) {
  }
  ::kill(child, SIGKILL);
  ::waitpid(child, nullptr, 0);
  while (::read(pipe_ends[0], &finished, sizeof finished) == sizeof finished) {
  }
  ::close(pipe_ends[0]);

  return finished;
}

/// Recordings of recorders killed at random moments, and what each of them had finished.
class KilledRecorders : public ::testing::Test {
 protected:
  static constexpr int kRounds = 50;
  struct Remains {
    std::filesystem::path file;
    std::uint64_t finished = 0;
  };
  KilledRecorders() {
    std::mt19937 random{50};
    std::uniform_int_distribution<unsigned> moment{1, 12};
    for (int round = 0; round < kRounds; ++round) {
      const auto folder = folder_.path() / std::to_string(round);
      std::filesystem::create_directory(folder);
      remains_.push_back({folder / "run.mcap.part", killed_recorder(folder, moment(random))});
    }
  }
  TemporaryFolder folder_;
  std::vector<Remains> remains_;
};

TEST_F(KilledRecorders, LeaveEveryFinishedChunkReadableAtFiftyRandomMoments) {
  for (const Remains& killed : remains_) {
    ASSERT_GT(killed.finished, 0u);
    const auto reader = RecordingReader::open(killed.file);
    ASSERT_TRUE(reader) << reader.error().text;
    ASSERT_GE(reader->message_count(), killed.finished) << killed.file;
    std::uint32_t i = 0;
    for (auto cursor = reader->messages(); const auto message = cursor.next(); ++i) {
      ASSERT_EQ(message->taken, example_time(i)) << killed.file;
    }
  }
}

TEST_F(KilledRecorders, LeaveEveryFinishedChunkReadableByThePublicLibrary) {
  if (!PublicLibraries::available()) GTEST_SKIP() << PublicLibraries::kSkipped;
  std::string files;
  for (const Remains& killed : remains_) files += " '" + killed.file.string() + "'";
  const auto seen = PublicLibraries::verify("parts" + files);
  ASSERT_EQ(seen.size(), remains_.size());
  for (std::size_t k = 0; k < remains_.size(); ++k) {
    EXPECT_GE(seen[k].get<std::uint64_t>(), remains_[k].finished) << remains_[k].file;
  }
}

}  // namespace
}  // namespace abbe::daemon
