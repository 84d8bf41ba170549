/// The index of a store, and the removal of old models.

#include <gmock/gmock.h>
#include <sys/stat.h>
#include <unistd.h>

#include <algorithm>
#include <chrono>
#include <filesystem>
#include <fstream>
#include <string>
#include <vector>

#include "abbe/model/model_store.hpp"
#include "synthetic_model.hpp"
#include "text_files.hpp"

namespace abbe::daemon {
namespace {

namespace fs = std::filesystem;
using namespace std::chrono_literals;
using test::synthetic_document;
using test::text_of;
using ::testing::ElementsAre;
using ::testing::HasSubstr;
using ::testing::IsEmpty;
using ::testing::SizeIs;

class ModelIndexTest : public ::testing::Test {
 protected:
  ModelIndexTest() { fs::remove_all(folder_); }
  ~ModelIndexTest() override { fs::remove_all(folder_); }

  ModelStore store() { return ModelStore::open(folder_).value(); }
  StoreActor at(std::chrono::hours age) {
    return {"tester", "test", protocol::UtcTime{std::chrono::hours{24 * 365 * 50}} - age};
  }
  std::string add(unsigned seed, std::chrono::hours age = 0h) {
    return store().add(synthetic_document(seed), true, {}, at(age)).value();
  }
  std::vector<std::string> listed() {
    const auto entries = store().list().value();
    std::vector<std::string> ids;
    for (const auto& entry : entries) ids.push_back(entry.id);
    return ids;
  }
  fs::path index() const { return folder_ / "index.sqlite"; }
  /// Replaces the bytes of a model and keeps its time, size and inode: a list that reads the file
  /// again reports a fault.
  void damage_unnoticed(const std::string& id) {
    const fs::path file = store().model_path(id);
    const auto written = fs::last_write_time(file);
    const std::string bytes(fs::file_size(file), 'x');
    std::fstream(file, std::ios::in | std::ios::out | std::ios::binary) << bytes;
    fs::last_write_time(file, written);
  }

  fs::path folder_ =
      fs::path(::testing::TempDir()) /
      (std::string("index_") + ::testing::UnitTest::GetInstance()->current_test_info()->name());
};

TEST_F(ModelIndexTest, AModelInTheIndexIsNotReadAgain) {
  const auto id = add(1);
  damage_unnoticed(id);
  const auto entries = store().list().value();
  ASSERT_THAT(entries, SizeIs(1));
  EXPECT_EQ(entries[0].fault, "");
  EXPECT_EQ(entries[0].method, "otf");
  EXPECT_EQ(entries[0].machine, synthetic_document(1).machine);
  EXPECT_THAT(entries[0].inputs, ElementsAre("path.csv", "tracker.csv"));
}

TEST_F(ModelIndexTest, AFileThatChangedIsReadAgain) {
  const auto id = add(1);
  std::ofstream(store().model_path(id)) << "not a model";
  EXPECT_THAT(store().list().value()[0].fault, HasSubstr(id));
  fs::remove(store().model_path(id));
  (void)store().add(synthetic_document(1), true, {}, at(0h));
  EXPECT_EQ(store().list().value()[0].fault, "");
}

TEST_F(ModelIndexTest, AMissingIndexIsMadeAgain) {
  const auto id = add(1);
  fs::remove(index());
  EXPECT_THAT(listed(), ElementsAre(id));
  ASSERT_TRUE(fs::exists(index()));
  damage_unnoticed(id);
  EXPECT_EQ(store().list().value()[0].fault, "");
}

TEST_F(ModelIndexTest, ADamagedIndexIsMadeAgain) {
  const auto id = add(1);
  std::ofstream(index()) << "this is no database, but longer than the header of one";
  EXPECT_THAT(listed(), ElementsAre(id));
  EXPECT_THAT(text_of(index()), HasSubstr("SQLite format 3"));
}

// The page behind the header, which holds the rows.
TEST_F(ModelIndexTest, ADamagedPageOfTheIndexIsMadeAgain) {
  const auto id = add(1);
  std::string bytes = text_of(index());
  constexpr std::size_t kPage = 4096;
  ASSERT_GE(bytes.size(), 2 * kPage);
  std::fill(bytes.begin() + kPage, bytes.begin() + 2 * kPage, 'x');
  std::ofstream(index(), std::ios::binary) << bytes;
  EXPECT_THAT(listed(), ElementsAre(id));
  damage_unnoticed(id);
  EXPECT_EQ(store().list().value()[0].fault, "");  // it was added to the new index
}

// Any flipped bit: a list may read models again, but never shows what they do not contain.
TEST_F(ModelIndexTest, AFlippedBitChangesNoEntry) {
  const auto id = add(1);
  const std::string good = text_of(index());
  ASSERT_GT(good.size(), 1000U);
  const auto machine = synthetic_document(1).machine;
  for (std::size_t i = 7; i < good.size(); i += 97) {
    std::string flipped = good;
    flipped[i] = static_cast<char>(flipped[i] ^ (1 << (i % 8)));
    std::ofstream(index(), std::ios::binary) << flipped;
    const auto entries = store().list().value();
    ASSERT_THAT(entries, SizeIs(1)) << "byte " << i;
    EXPECT_EQ(entries[0].id + entries[0].machine + entries[0].fault, id + machine) << "byte " << i;
  }
}

TEST_F(ModelIndexTest, AnIndexThatIsNoFileIsNotOpened) {
  const auto id = add(1);
  fs::remove(index());
  ASSERT_EQ(::mkfifo(index().c_str(), 0600), 0);
  EXPECT_THAT(listed(), ElementsAre(id));
}

TEST_F(ModelIndexTest, TheNewestModelsAreKept) {
  std::vector<std::string> ids;
  for (unsigned seed = 1; seed <= 5; ++seed) ids.push_back(add(seed, 100h));
  EXPECT_THAT(store().remove_old({.keep_newest = 2}, at(0h)).value(),
              ElementsAre(ids[0], ids[1], ids[2]));
  EXPECT_THAT(listed(), ::testing::UnorderedElementsAre(ids[3], ids[4]));
  EXPECT_FALSE(fs::exists(store().model_path(ids[0])));
  EXPECT_THAT(store().history().value(), SizeIs(5 + 3));
}

TEST_F(ModelIndexTest, YoungModelsAreKeptBeyondTheNumber) {
  const auto old = add(1, 49h), young = add(2, 47h), newest = add(3, 0h);
  EXPECT_THAT(store().remove_old({.keep_newest = 1, .keep = 48h}, at(0h)).value(),
              ElementsAre(old));
}

// The clock is set two years ahead: the number counts.
TEST_F(ModelIndexTest, AClockThatIsAheadRemovesNoneOfTheNewest) {
  for (unsigned seed = 1; seed <= 3; ++seed) (void)add(seed);
  EXPECT_THAT(store().remove_old({.keep_newest = 3, .keep = 48h}, at(-17520h)).value(), IsEmpty());
}

TEST_F(ModelIndexTest, ModelsInForceAreKept) {
  const auto first = add(1), second = add(2), active = add(3), other = add(4);
  for (const auto& id : {first, active}) ASSERT_TRUE(store().activate(id, at(0h)));
  EXPECT_THAT(store().remove_old({.keep_newest = 1}, at(-1h)).value(), ElementsAre(second));
  EXPECT_EQ(store().rollback(at(-2h), active).value(), first);
  EXPECT_EQ(store().active_id().value(), first);
  EXPECT_TRUE(store().load(other));
}

TEST_F(ModelIndexTest, WithoutANumberAllModelsAreKept) {
  (void)add(1, 1000h);
  EXPECT_THAT(store().remove_old({.keep = 1h}, at(0h)).value(), IsEmpty());
  EXPECT_THAT(listed(), SizeIs(1));
}

TEST_F(ModelIndexTest, ARemovedModelCanBeAddedAgain) {
  const auto id = add(1);
  (void)add(2);
  ASSERT_THAT(store().remove_old({.keep_newest = 1}, at(-1h)).value(), ElementsAre(id));
  ASSERT_EQ(add(1), id);
  EXPECT_THAT(listed(), SizeIs(2));
  EXPECT_TRUE(store().activate(id, at(-2h)));
}

}  // namespace
}  // namespace abbe::daemon
