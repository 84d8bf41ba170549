#include "abbe/model/model_store.hpp"

#include <fcntl.h>
#include <fmt/format.h>
#include <gmock/gmock.h>
#include <signal.h>
#include <sys/file.h>
#include <sys/stat.h>
#include <sys/wait.h>
#include <unistd.h>

#include <fstream>

#include "synthetic_model.hpp"
#include "text_files.hpp"

namespace abbe::daemon {
namespace {

namespace fs = std::filesystem;
using test::synthetic_document;
using test::text_of;
using ::testing::ElementsAre;
using ::testing::HasSubstr;
using ::testing::IsEmpty;
using ::testing::SizeIs;

mode_t mode_of(const fs::path& file) {
  struct stat status {};
  return ::stat(file.c_str(), &status) == 0 ? status.st_mode & 0777U : 0;
}

uid_t owner_of(const fs::path& file) {
  struct stat status {};
  return ::stat(file.c_str(), &status) == 0 ? status.st_uid : static_cast<uid_t>(-1);
}

class ModelStoreTest : public ::testing::Test {
 protected:
  ModelStoreTest() { fs::remove_all(folder_); }
  ~ModelStoreTest() override { fs::remove_all(folder_); }
  ModelStore open() { return ModelStore::open(folder_).value(); }
  std::string add(unsigned seed, bool accepted = true, std::vector<std::string> reasons = {}) {
    return open()
        .add(synthetic_document(seed), accepted, std::move(reasons), actor("daemon"))
        .value();
  }
  StoreActor actor(std::string why) {
    now_ += std::chrono::seconds{1};
    return {"tester", std::move(why), now_};
  }

  fs::path folder_ =
      fs::path(::testing::TempDir()) /
      (std::string("store_") + ::testing::UnitTest::GetInstance()->current_test_info()->name());
  protocol::UtcTime now_{std::chrono::hours{24 * 365}};
};

TEST_F(ModelStoreTest, ListsTheModelThatWasAddedLastFirstAlsoAfterTheClockWasSetBack) {
  const auto first = add(1);
  now_ -= std::chrono::hours{24 * 200};
  const auto second = add(2), third = add(3);
  const auto entries = open().list().value();
  ASSERT_THAT(entries, SizeIs(3));
  EXPECT_EQ(entries[0].id, third);
  EXPECT_EQ(entries[1].id, second);
  EXPECT_EQ(entries[2].id, first);
}

TEST_F(ModelStoreTest, IsEmptyWhenNew) {
  EXPECT_THAT(open().list().value(), IsEmpty());
  EXPECT_EQ(open().active_id().value(), std::nullopt);
}

TEST_F(ModelStoreTest, KeepsWhatIsAddedAndGivesItBack) {
  const auto id = add(1);
  const auto document = open().load(id);
  ASSERT_TRUE(document);
  EXPECT_EQ(model_id(*document), id);
  EXPECT_EQ(model_hash(*document), model_hash(synthetic_document(1)));
  EXPECT_EQ(open().find(id.substr(0, 6)).value(), id);
}

TEST_F(ModelStoreTest, KeepsTheSameModelForEachMachineConfigurationItWasMadeFor) {
  auto document = synthetic_document(1);
  const auto before = open().add(document, true, {}, actor("daemon")).value();
  document.machine_hash = "cd34";
  const auto after = open().add(document, false, {"no better"}, actor("daemon")).value();
  ASSERT_NE(before, after);
  EXPECT_EQ(open().load(before)->machine_hash, "ab12");
  EXPECT_EQ(open().load(after)->machine_hash, "cd34");
}

TEST_F(ModelStoreTest, ActivatesAndRollsBackThroughSeveralModels) {
  const auto a = add(1), b = add(2), c = add(3);
  auto store = open();
  for (const auto& id : {a, b, c}) ASSERT_TRUE(store.activate(id, actor("better")));
  EXPECT_EQ(store.active_id().value(), c);
  EXPECT_EQ(store.rollback(actor("drifts"), c).value(), b);
  EXPECT_EQ(store.rollback(actor("worse"), b).value(), a);
  EXPECT_EQ(open().active_id().value(), a);
  const auto none = store.rollback(actor("worse still"), a);
  ASSERT_FALSE(none);
  EXPECT_EQ(none.error().code, ErrorCode::Refused);
}

TEST_F(ModelStoreTest, ARepeatedRollBackDoesNotGoFurtherBack) {
  const auto a = add(1), b = add(2), c = add(3);
  auto store = open();
  for (const auto& id : {a, b, c}) ASSERT_TRUE(store.activate(id, actor("better")));
  ASSERT_TRUE(store.rollback(actor("drifts"), c));
  const auto again = store.rollback(actor("drifts"), c);
  ASSERT_FALSE(again);
  EXPECT_EQ(again.error().code, ErrorCode::Refused);
  EXPECT_EQ(open().active_id().value(), b);
}

TEST_F(ModelStoreTest, AModelActivatedTwiceIsRolledBackAtOnce) {
  const auto a = add(1), b = add(2);
  auto store = open();
  for (const auto& id : {a, b, b}) ASSERT_TRUE(store.activate(id, actor("better")));
  EXPECT_EQ(store.rollback(actor("drifts"), b).value(), a);
  EXPECT_EQ(open().active_id().value(), a);
  EXPECT_FALSE(store.rollback(actor("again"), a));
}

// As versions before wrote it: a rollback to the model that was active already.
TEST_F(ModelStoreTest, ARollbackActivatesTheModelItReports) {
  const auto a = add(1), b = add(2);
  auto store = open();
  for (const auto& id : {a, b, b}) ASSERT_TRUE(store.activate(id, actor("better")));
  ASSERT_TRUE(store.rollback(actor("drifts"), b));
  std::string text = text_of(folder_ / "state.json");
  // The keys of an event are in order: the id follows its action.
  text.replace(text.find(a, text.rfind("rolled-back")), a.size(), b);
  std::ofstream(folder_ / "state.json") << text;
  EXPECT_EQ(open().active_id().value(), b);
}

TEST_F(ModelStoreTest, WhatIsWrittenKeepsTheModeAndNewFilesTakeThatOfTheirFolder) {
  const auto id = add(1);
  fs::permissions(folder_ / "state.json", fs::perms{0640});
  const mode_t before = ::umask(077);
  const auto second = add(2);
  ::umask(before);
  EXPECT_EQ(mode_of(folder_ / "state.json"), 0640u);
  EXPECT_EQ(mode_of(open().model_path(second)), mode_of(folder_ / "models") & 0664u);
}

TEST_F(ModelStoreTest, AFreshStoreOfRootBelongsToTheFolderItIsIn) {
  if (::geteuid() != 0) GTEST_SKIP() << "only root can give files away";
  constexpr uid_t kDaemon = 4711;
  ASSERT_EQ(::chown((fs::create_directory(folder_), folder_.c_str()), kDaemon, kDaemon), 0);
  const mode_t before = ::umask(077);
  const auto id =
      ModelStore::open(folder_ / "store")->add(synthetic_document(1), true, {}, actor("root"));
  ::umask(before);
  for (const char* file : {"store", "store/models", "store/lock", "store/state.json"})
    EXPECT_EQ(owner_of(folder_ / file), kDaemon) << file;
  EXPECT_EQ(owner_of(ModelStore::open(folder_ / "store")->model_path(id.value())), kDaemon);
  EXPECT_EQ(mode_of(folder_ / "store/state.json"), mode_of(folder_) & 0664u);
}

TEST_F(ModelStoreTest, RefusesARefusedModelUnlessForced) {
  const auto id = add(1, false, {"largest error 3 mm"});
  auto store = open();
  const auto refused = store.activate(id, actor("hope"));
  ASSERT_FALSE(refused);
  EXPECT_EQ(refused.error().code, ErrorCode::Refused);
  EXPECT_THAT(refused.error().text, HasSubstr("largest error 3 mm"));
  ASSERT_TRUE(store.activate(id, actor("measured by hand"), true));
  const auto last = store.history().value().back();
  EXPECT_EQ(last.action, StoreAction::Forced);
  EXPECT_EQ(last.actor.who, "tester");
  EXPECT_EQ(last.actor.why, "measured by hand");
}

TEST_F(ModelStoreTest, ListsNewestFirstWithVerdicts) {
  const auto a = add(1);
  const auto b = add(2, false, {"no better"});
  const auto entries = open().list().value();
  ASSERT_THAT(entries, SizeIs(2));
  EXPECT_EQ(entries[0].id, b);
  EXPECT_THAT(entries[0].reasons, ElementsAre("no better"));
  EXPECT_TRUE(entries[1].accepted);
}

TEST_F(ModelStoreTest, ListsADamagedModelWithItsFault) {
  const auto a = add(1), b = add(2);
  fs::resize_file(open().model_path(a), 1000);
  const auto entries = open().list().value();
  ASSERT_THAT(entries, SizeIs(2));
  EXPECT_EQ(entries[0].fault, "");
  EXPECT_THAT(entries[1].fault, HasSubstr(a));
  EXPECT_FALSE(open().activate(a, actor("try")));
  EXPECT_TRUE(open().activate(b, actor("whole")));
}

TEST_F(ModelStoreTest, RefusesAModelUnderAnotherName) {
  const auto a = add(1), b = add(2);
  fs::copy_file(open().model_path(a), open().model_path(b), fs::copy_options::overwrite_existing);
  const auto document = open().load(b);
  ASSERT_FALSE(document);
  EXPECT_THAT(document.error().text, HasSubstr("the id of the model differs from the file name"));
}

TEST_F(ModelStoreTest, IsNotDisturbedByAHalfWrittenFile) {
  const auto a = add(1);
  ASSERT_TRUE(open().activate(a, actor("good")));
  std::ofstream(folder_ / "state.json.77.new") << "{\"schema\": \"abbe/st";
  std::ofstream(folder_ / "models" / "0123456789abcdef.json.77.new") << "{";
  EXPECT_EQ(open().active_id().value(), a);
  EXPECT_THAT(open().list().value(), SizeIs(1));
}

TEST_F(ModelStoreTest, ListsAModelWhoseFileIsGoneWithItsFault) {
  const auto a = add(1);
  fs::remove(open().model_path(a));
  const auto entries = open().list().value();
  ASSERT_THAT(entries, SizeIs(1));
  EXPECT_EQ(entries[0].id, a);
  EXPECT_THAT(entries[0].fault, HasSubstr(a));
}

TEST_F(ModelStoreTest, ReportsThatItCannotBeListed) {
  add(1);
  const auto store = open();
  fs::rename(folder_ / "models", folder_ / "elsewhere");
  EXPECT_THAT(store.list().error().text, HasSubstr("list "));
  EXPECT_EQ(store.find("0123").error().code, ErrorCode::Io);
}

TEST_F(ModelStoreTest, DoesNotBlockOnAPipeInItsFolder) {
  add(1);
  const auto piped = add(2);
  fs::remove(open().model_path(piped));
  ASSERT_EQ(::mkfifo(open().model_path(piped).c_str(), 0600), 0);
  const auto entries = open().list().value();
  ASSERT_THAT(entries, SizeIs(2));
  for (const auto& entry : entries)
    EXPECT_EQ(entry.fault.find("is not a regular file") != std::string::npos, entry.id == piped)
        << entry.fault;
  fs::remove(folder_ / "state.json");
  ASSERT_EQ(::mkfifo((folder_ / "state.json").c_str(), 0600), 0);
  EXPECT_THAT(ModelStore::open(folder_).error().text, HasSubstr("is not a regular file"));
}

// A user who can open the lock file can hold the lock.
TEST_F(ModelStoreTest, TheLockIsAccessibleToUsersWhoMayWriteToTheStore) {
  fs::create_directories(folder_);
  fs::permissions(folder_, fs::perms{0755});
  add(1);
  EXPECT_EQ(mode_of(folder_ / "lock"), 0600u);
  fs::permissions(folder_ / "lock", fs::perms{0644});  // as versions before made it
  add(2);
  EXPECT_EQ(mode_of(folder_ / "lock"), 0600u);
  fs::permissions(folder_, fs::perms{0775});
  add(3);
  EXPECT_EQ(mode_of(folder_ / "lock"), 0660u);
}

TEST_F(ModelStoreTest, AModelIsOnTheDiskAlsoWhenTheLockIsHeldAndTheHolderIsNamed) {
  add(1);
  const int lock = ::open((folder_ / "lock").c_str(), O_RDONLY | O_CLOEXEC);
  ASSERT_EQ(::flock(lock, LOCK_EX), 0);
  const auto document = synthetic_document(2);
  const auto added = open().add(document, true, {}, actor("daemon"));
  ASSERT_FALSE(added);
  EXPECT_THAT(added.error().text, HasSubstr("held it for 5 s"));

  if (std::ifstream{"/proc/locks"}.peek() != std::ifstream::traits_type::eof()) {
    EXPECT_THAT(added.error().text, HasSubstr(fmt::format("(process {})", ::getpid())));
  }

  EXPECT_TRUE(open().load(model_id(document)));
  ::close(lock);
  EXPECT_TRUE(open().add(document, true, {}, actor("daemon")));
}

TEST_F(ModelStoreTest, ReportsThatTheStateIsDamaged) {
  add(1);
  fs::resize_file(folder_ / "state.json", 20);
  const auto store = ModelStore::open(folder_);
  ASSERT_FALSE(store);
  EXPECT_EQ(store.error().code, ErrorCode::BadInput);
  EXPECT_THAT(store.error().text, HasSubstr("state.json"));
}

// A process that only activates models is killed at ever later moments. After each kill the store
// opens and one of the two models is active.
TEST_F(ModelStoreTest, SurvivesAKillAtAnyMoment) {
  const auto a = add(1), b = add(2);
  ASSERT_TRUE(open().activate(a, actor("start")));
  for (int round = 0; round < 12; ++round) {
    const pid_t child = ::fork();
    ASSERT_GE(child, 0);
    if (child == 0) {
      auto store = open();
      for (int i = 0;; ++i) static_cast<void>(store.activate(i % 2 == 0 ? b : a, actor("again")));
    }
    ::usleep(static_cast<useconds_t>(1000 + 1700 * round));
    ::kill(child, SIGKILL);
    int status = 0;

    ASSERT_EQ(::waitpid(child, &status, 0), child);
    const auto store = ModelStore::open(folder_);
    ASSERT_TRUE(store) << store.error().text;
    const auto active = store->active_id().value();
    EXPECT_TRUE(active == a || active == b);
  }
}

TEST_F(ModelStoreTest, FindsByPrefixOrReportsTheNumberOfMatches) {
  const auto id = add(1);
  EXPECT_EQ(open().find("active").error().code, ErrorCode::Usage);
  EXPECT_EQ(open().find("zzzz").error().code, ErrorCode::Usage);
  ASSERT_TRUE(open().activate(id, actor("good")));
  EXPECT_EQ(open().find("active").value(), id);
}

TEST_F(ModelStoreTest, AShortPrefixListsTheIdsThatBeginWithIt) {
  const auto id = add(1);
  const auto refused = open().find(id.substr(0, 3));
  ASSERT_FALSE(refused);
  EXPECT_EQ(refused.error().code, ErrorCode::Usage);
  EXPECT_NE(refused.error().text.find("at least 4 characters"), std::string::npos);
  EXPECT_EQ(refused.error().details, std::vector<std::string>{id});
}

}  // namespace
}  // namespace abbe::daemon
