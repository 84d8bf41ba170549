#include "abbe/recording/old_recordings.hpp"

#include <gmock/gmock.h>

#include <fstream>

#include "abbe/model/model_store.hpp"
#include "recording_fixture.hpp"
#include "synthetic_model.hpp"

namespace abbe::daemon {
namespace {

namespace fs = std::filesystem;
using namespace std::chrono_literals;
using ::testing::ElementsAre;
using ::testing::IsEmpty;

class OldRecordings : public ::testing::Test {
 protected:
  OldRecordings() { EXPECT_TRUE(ModelStore::open(store_)); }
  void record(const std::string& name, std::chrono::hours ago) {
    std::ofstream{folder_.path() / name} << "content";
    fs::last_write_time(folder_.path() / name, now_ - ago);
  }
  std::string keep_model_of(unsigned seed, const std::string& input) {
    auto document = test::synthetic_document(seed);
    document.inputs = {{input, std::string(64, 'a')}};
    return ModelStore::open(store_)->add(document, true, {}, {"test", "test", {}}).value();
  }
  [[nodiscard]] Result<std::vector<fs::path>> remove(std::chrono::hours clock_ahead = 0h) {
    return remove_old_recordings(folder_.path(), store_,
                                 {now_ + clock_ahead, 24h, "abbe-47", lasted_});
  }
  [[nodiscard]] std::vector<std::string> removed(std::chrono::hours clock_ahead = 0h) {
    std::vector<std::string> names;
    const auto gone = remove(clock_ahead);
    EXPECT_TRUE(gone) << gone.error().text;
    if (gone)
      for (const auto& file : *gone) {
        EXPECT_FALSE(fs::exists(file));
        names.push_back(file.filename());
      }
    return names;
  }

  fs::file_time_type now_ = fs::file_time_type::clock::now();
  std::chrono::hours lasted_ = 1h;
  TemporaryFolder folder_;
  fs::path store_ = folder_.path() / "models";
};

TEST_F(OldRecordings, AreRemovedWhenTheyAreOlder) {
  record("abbe-1.mcap", 25h);
  record("abbe-2.mcap.part", 25h);
  record("abbe-3.mcap", 23h);
  record("abbe-4.mcap", 0h);
  EXPECT_THAT(removed(), ElementsAre("abbe-1.mcap", "abbe-2.mcap.part"));
  EXPECT_THAT(removed(), IsEmpty());
}

TEST_F(OldRecordings, OfThisRunAreRemovedWhenOldExceptTheOneBeingWritten) {
  record("abbe-47.mcap", 100h);
  record("abbe-47-2.mcap", 23h);
  record("abbe-47-3.mcap.part", 50h);
  record("abbe-471.mcap", 50h);
  record("abbe-48.mcap", 0h);
  EXPECT_THAT(removed(), ElementsAre("abbe-47.mcap", "abbe-471.mcap"));
}

TEST_F(OldRecordings, OfAFormerRunAreOldWhenThisOneHasLastedLonger) {
  record("abbe-1.mcap", 25h);
  EXPECT_THAT(removed(), IsEmpty());  // it is the newest: the clock may be ahead
  lasted_ = 25h;
  record("abbe-2.mcap", 0h);  // brought here since
  EXPECT_THAT(removed(), ElementsAre("abbe-1.mcap"));
}

TEST_F(OldRecordings, StayWhenTheClockRunsAhead) {
  record("abbe-1.mcap", 2h);
  record("abbe-2.mcap", 1h);
  record("abbe-47.mcap.part", -24h * 365);  // what this run writes is dated by the wrong clock, too
  EXPECT_THAT(removed(24h * 365), IsEmpty());
}

TEST_F(OldRecordings, StayWhenOneIsDatedInTheFuture) {
  record("abbe-1.mcap", 2h);
  record("abbe-2.mcap", -24h * 365);
  EXPECT_THAT(removed(), IsEmpty());
}

TEST_F(OldRecordings, DatedByAStoppedClockStay) {
  record("abbe-1.mcap", 0h);
  fs::last_write_time(folder_.path() / "abbe-1.mcap",
                      std::chrono::file_clock::from_sys(std::chrono::sys_seconds{24h}));
  record("abbe-2.mcap", 0h);
  EXPECT_THAT(removed(), IsEmpty());
}

TEST_F(OldRecordings, ThatAModelNamesStay) {
  record("abbe-9.mcap", 0h);
  record("abbe-1.mcap", 25h);
  record("abbe-1-2.mcap", 25h);
  record("abbe-4.mcap", 25h);
  keep_model_of(1, "abbe-1.mcap.part (4711 bytes)");
  keep_model_of(2, "abbe-4.mcap");
  EXPECT_THAT(removed(), ElementsAre("abbe-1-2.mcap"));
}

TEST_F(OldRecordings, StayAllWhileAModelCannotBeRead) {
  record("abbe-1.mcap", 25h);
  record("abbe-2.mcap", 0h);
  const auto id = keep_model_of(1, "abbe-1.mcap");
  fs::resize_file(ModelStore::open(store_)->model_path(id), 10);
  EXPECT_FALSE(remove());
  EXPECT_TRUE(fs::exists(folder_.path() / "abbe-1.mcap"));
}

TEST_F(OldRecordings, StayAllWhileAModelIsGone) {
  record("abbe-1.mcap", 25h);
  record("abbe-2.mcap", 0h);
  fs::remove(ModelStore::open(store_)->model_path(keep_model_of(1, "abbe-1.mcap")));
  EXPECT_FALSE(remove());
  EXPECT_TRUE(fs::exists(folder_.path() / "abbe-1.mcap"));
}

TEST_F(OldRecordings, StayAllWithoutAStore) {
  record("abbe-1.mcap", 25h);
  record("abbe-2.mcap", 0h);
  fs::remove_all(store_);
  EXPECT_FALSE(remove());
  EXPECT_TRUE(fs::exists(folder_.path() / "abbe-1.mcap"));
  EXPECT_FALSE(fs::exists(store_));
}

TEST_F(OldRecordings, FilesOfOtherProgramsStay) {
  record("abbe-9.mcap", 0h);
  record("notes.txt", 25h);
  record("reference.mcap", 25h);
  EXPECT_THAT(removed(), IsEmpty());
}

}  // namespace
}  // namespace abbe::daemon
