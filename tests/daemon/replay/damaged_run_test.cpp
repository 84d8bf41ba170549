// A recording of a whole run with one damaged bit: no model comes of it that looks as sure as that
// of the whole one.

#include <gmock/gmock.h>
#include <unistd.h>

#include <algorithm>
#include <string_view>

#include "abbe/protocol/mcap/reader.hpp"
#include "abbe/recording/recording_reader.hpp"
#include "abbe/replay/replay.hpp"
#include "abbe_command.hpp"
#include "recording_fixture.hpp"
#include "repetitions.hpp"
#include "synthetic_otf_recording.hpp"

namespace abbe::daemon {
namespace {

namespace fs = std::filesystem;
using ::testing::HasSubstr;
using ::testing::IsEmpty;
using ::testing::Not;

class DamagedRun : public ::testing::Test {
 protected:
  static void SetUpTestSuite() {
    folder_ = fs::path(::testing::TempDir()) / fmt::format("damaged_run_{}", ::getpid());
    whole_ = test::record_synthetic_run(folder_);
  }
  static void TearDownTestSuite() { fs::remove_all(folder_); }

  /// The recording with another byte at `at`.
  static fs::path damaged(std::size_t at, int flip) {
    auto bytes = bytes_of_file(whole_);
    bytes[at] = static_cast<char>(bytes[at] ^ flip);
    const auto file = folder_ / "damaged.mcap";
    write_file(file, bytes, bytes.size());
    return file;
  }
  static std::size_t place_of(std::string_view text) {
    const auto bytes = bytes_of_file(whole_);
    const auto at = std::search(bytes.begin(), bytes.end(), text.begin(), text.end());
    EXPECT_NE(at, bytes.end()) << text;
    return static_cast<std::size_t>(at - bytes.begin());
  }
  static test::Ran abbe(const std::string& arguments) { return test::run_abbe(folder_, arguments); }
  static test::Ran identify(const fs::path& file, const std::string& more = "") {
    return abbe(fmt::format("identify otf --recording '{}' -o '{}' {}", file.string(),
                            (folder_ / "out").string(), more));
  }

  static inline fs::path folder_, whole_;
};

TEST_F(DamagedRun, UndamagedItGivesAModelThatTheGateAccepts) {
  EXPECT_EQ(abbe(fmt::format("replay '{}'", whole_.string())).exit, 0);
  const auto identified = identify(whole_);
  EXPECT_EQ(identified.exit, 0) << identified.err;
  EXPECT_THAT(test::text_of(folder_ / "out" / "model.json"), Not(HasSubstr("recording_gap")));
}

TEST_F(DamagedRun, CutInTheRunItDoesNotShowACalibrationThatGoesOn) {
  const auto bytes = bytes_of_file(whole_);
  const auto cut = folder_ / "cut.mcap.part";
  write_file(cut, bytes, bytes.size() / 2);

  const auto replayed = abbe(fmt::format("replay '{}'", cut.string()));
  EXPECT_EQ(replayed.exit, 1);
  EXPECT_THAT(replayed.out, HasSubstr("the recording ends before the calibration is complete"));
  EXPECT_THAT(replayed.out, Not(HasSubstr("calibration  acquiring")));

  const auto identified = identify(cut);
  EXPECT_EQ(identified.exit, 1);
  EXPECT_THAT(identified.err, HasSubstr("contains no complete calibration: the recording ends"));
}

// node_spacing_mm = 60 becomes 20: the model would be another.
TEST_F(DamagedRun, WithADamagedConfigurationIsRefusedUnlessAConfigurationIsGiven) {
  const auto file = damaged(place_of("node_spacing_mm = 60") + 18, 4);
  for (const auto& ran : {abbe(fmt::format("replay '{}'", file.string())), identify(file)}) {
    EXPECT_EQ(ran.exit, 3);
    EXPECT_THAT(ran.err, HasSubstr("recorded configuration is damaged"));
  }
  const auto machine = folder_ / "machine.toml";
  test::write_text(machine, test::synthetic_recorded_toml());
  EXPECT_EQ(identify(file, fmt::format("--machine '{}'", machine.string())).exit, 0);
}

TEST_F(DamagedRun, WithADamagedChunkTheGateRefusesItsModelAndTheReplayEndsWithOne) {
  const auto file = damaged(place_in_chunk(bytes_of_file(whole_), 5), 1);
  const auto replayed = abbe(fmt::format("replay '{}'", file.string()));
  EXPECT_EQ(replayed.exit, 1);
  EXPECT_THAT(replayed.out, HasSubstr("the recording is damaged: chunk 6"));
  const auto identified = identify(file);
  EXPECT_EQ(identified.exit, 5);
  EXPECT_THAT(identified.out, HasSubstr("the recording is damaged: chunk 6"));
  EXPECT_THAT(test::text_of(folder_ / "out" / "model.json"),
              HasSubstr("\"recording_gap\": \"the recording is"));
}

TEST_F(DamagedRun, TruncatedAfterTheRunItStillGivesItsModel) {
  auto bytes = bytes_of_file(whole_);
  const auto file = folder_ / "cut.mcap";
  write_file(file, bytes, bytes.size() - 3000);  // in the summary
  EXPECT_EQ(abbe(fmt::format("replay '{}'", file.string())).exit, 0);
}

TEST_F(DamagedRun, AFlippedBitOfTheMetadataIsDetected) {
  const TemporaryFolder folder;
  auto bytes = bytes_of_file(example_recording(folder.path(), 1, 5));
  protocol::mcap::LinearScan scan{std::as_bytes(std::span{bytes})};
  std::size_t begin = 0, end = 0;

  while (const auto item = scan.next()) {
    if (item->record.opcode != protocol::mcap::Opcode::Metadata) continue;
    if (begin == 0) begin = item->record.offset;
    end = item->record.end();
  }

  ASSERT_LT(begin, end);
  // Behind the head: every third byte; with a sanitizer a tenth of that.
  constexpr std::size_t kHead = 100, kInHead = tests::kAllRepetitions ? 1 : 10,
                        kStep = tests::kAllRepetitions ? 3 : 31;
  for (std::size_t at = begin; at < end; at += at - begin < kHead ? kInHead : kStep)
    for (int bit = at % 7 == 0 ? 1 : 16; bit < 256; bit *= at % 7 == 0 ? 2 : 16) {
      bytes[at] = static_cast<char>(bytes[at] ^ bit);
      write_file(folder.path() / "flipped.mcap", bytes, bytes.size());
      bytes[at] = static_cast<char>(bytes[at] ^ bit);
      const auto reader = RecordingReader::open(folder.path() / "flipped.mcap");
      if (!reader) continue;
      const bool shows =
          !reader->damage().empty() || reader->configuration_check() == MetadataCheck::Damaged;
      ASSERT_TRUE(shows) << "bit " << bit << " of byte " << at << ", metadata from " << begin
                         << " to " << end;
    }
}

TEST_F(DamagedRun, ARecordingWithoutConfigurationChecksumIsReadAndNotedAsUnchecked) {
  auto bytes = bytes_of_file(whole_);
  for (const std::string_view key : {"entries_sha256", "sha256"})
    for (auto at = bytes.begin();; ++at) {
      at = std::search(at, bytes.end(), key.begin(), key.end());
      if (at == bytes.end()) break;
      *at = 'x';
    }

  const auto file = folder_ / "before.mcap";
  write_file(file, bytes, bytes.size());
  const auto reader = RecordingReader::open(file);

  ASSERT_TRUE(reader) << reader.error().text;
  EXPECT_EQ(reader->configuration_check(), MetadataCheck::Unchecked);
  EXPECT_THAT(reader->damage(), IsEmpty());
  const auto identified = identify(file);
  EXPECT_EQ(identified.exit, 0) << identified.err;
  EXPECT_THAT(identified.out, HasSubstr("has no checksum"));
}

}  // namespace
}  // namespace abbe::daemon
