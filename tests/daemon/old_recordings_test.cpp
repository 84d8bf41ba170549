#include "abbe/daemon/old_recordings.hpp"

#include <gmock/gmock.h>

#include <fstream>

#include "abbe/daemon/model_store.hpp"
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
  void record(const std::string& name, std::chrono::hours ago) {
    std::ofstream{folder_.path() / name} << "content";
    fs::last_write_time(folder_.path() / name, now_ - ago);
  }
  std::string keep_model_of(unsigned seed, const std::string& input) {
    auto document = test::synthetic_document(seed);
    document.inputs = {{input, std::string(64, 'a')}};
    return ModelStore::open(store_)->add(document, true, {}, {"test", "test", {}}).value();
  }
  [[nodiscard]] std::vector<std::string> removed() {
    std::vector<std::string> names;
    const auto gone = remove_old_recordings(folder_.path(), store_, now_ - 24h);
    EXPECT_TRUE(gone) << gone.error().text;
    if (gone)
      for (const auto& file : *gone) {
        EXPECT_FALSE(fs::exists(file));
        names.push_back(file.filename());
      }
    return names;
  }

  fs::file_time_type now_ = fs::file_time_type::clock::now();
  TemporaryFolder folder_;
  fs::path store_ = folder_.path() / "models";
};

TEST_F(OldRecordings, AreRemovedWhenTheyAreOlder) {
  record("abbe-1.mcap", 25h);
  record("abbe-2.mcap.part", 25h);
  record("abbe-3.mcap", 23h);
  EXPECT_THAT(removed(), ElementsAre("abbe-1.mcap", "abbe-2.mcap.part"));
  EXPECT_THAT(removed(), IsEmpty());
}

TEST_F(OldRecordings, ThatAModelNamesStay) {
  record("abbe-1.mcap", 25h);
  record("abbe-1-2.mcap", 25h);
  record("abbe-4.mcap", 25h);
  keep_model_of(1, "abbe-1.mcap.part (4711 bytes)");
  keep_model_of(2, "abbe-4.mcap");
  EXPECT_THAT(removed(), ElementsAre("abbe-1-2.mcap"));
}

TEST_F(OldRecordings, StayAllWhileAModelCannotBeRead) {
  record("abbe-1.mcap", 25h);
  const auto id = keep_model_of(1, "abbe-1.mcap");
  fs::resize_file(ModelStore::open(store_)->model_path(id), 10);
  EXPECT_FALSE(remove_old_recordings(folder_.path(), store_, now_));
  EXPECT_TRUE(fs::exists(folder_.path() / "abbe-1.mcap"));
}

TEST_F(OldRecordings, WhatOthersPutThereStays) {
  record("notes.txt", 25h);
  record("reference.mcap", 25h);
  EXPECT_THAT(removed(), IsEmpty());
}

}  // namespace
}  // namespace abbe::daemon
