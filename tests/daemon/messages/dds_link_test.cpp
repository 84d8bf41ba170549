#include "abbe/messages/dds_link.hpp"

#include <gmock/gmock.h>
#include <gtest/gtest.h>
#include <poll.h>
#include <signal.h>
#include <sys/socket.h>
#include <sys/stat.h>
#include <sys/un.h>
#include <sys/wait.h>
#include <unistd.h>

#include <cstdlib>
#include <filesystem>
#include <optional>
#include <string>

#include "dds_far_end.hpp"

namespace abbe::daemon {
namespace {

using test::FarEnd;
using test::messages;

using namespace std::chrono_literals;

std::vector<std::byte> state_payload(const std::string& machine, std::uint64_t sequence) {
  v1::ModelState state;
  state.machine(machine);
  state.sequence_number(sequence);
  std::vector<std::byte> payload;
  EXPECT_TRUE(encode(state, payload).has_value());
  return payload;
}

std::vector<std::byte> snapshot_payload(std::uint64_t sequence) {
  v1::Snapshot snapshot;
  snapshot.machine("m");
  snapshot.sequence_number(sequence);
  snapshot.position({1.0, 2.0, 3.0});
  std::vector<std::byte> payload;
  EXPECT_TRUE(encode(snapshot, payload).has_value());
  return payload;
}

std::vector<std::byte> slice_payload(const std::string& machine, std::uint32_t number,
                                     std::uint32_t slices) {
  v1::ErrorGrid grid;
  grid.machine(machine);
  grid.slice(number);
  grid.slices(slices);
  std::vector<std::byte> bytes;
  EXPECT_TRUE(encode(grid, bytes));
  return bytes;
}

class DdsLinkTest : public testing::Test {
 protected:
  DdsLinkTest() {
    std::string name = testing::TempDir() + "abbe-link-XXXXXX";
    directory_ = ::mkdtemp(name.data());
    path_ = directory_ / "dds.sock";
    auto link = DdsLink::listen(path_);
    EXPECT_TRUE(link.has_value());
    link_.emplace(std::move(*link));
  }
  ~DdsLinkTest() override { std::filesystem::remove_all(directory_); }

  std::filesystem::path directory_;
  std::filesystem::path path_;
  std::optional<DdsLink> link_;
};

TEST_F(DdsLinkTest, ReportsATwinWhateverThePartsInWhichItArrives) {
  const FarEnd far(path_);
  link_->poll();
  const std::string report{'\0', '\1', '\3', '\0', 'a', 'b', 'c'};  // after the answer to a beat
  for (const char c : report) {
    EXPECT_EQ(link_->twin(), "");
    ASSERT_EQ(::send(far.fd, &c, 1, 0), 1);
    link_->poll();
  }
  EXPECT_EQ(link_->twin(), "abc");
  far.report_twin("");
  link_->poll();
  EXPECT_EQ(link_->twin(), "");
}

TEST_F(DdsLinkTest, AnAbbeDdsThatDoesNotAnswerIsNotReportedAsConnected) {
  EXPECT_STREQ(link_->state(), "waiting");
  const FarEnd hung(path_);
  link_->poll();
  DdsLink::WallTime now{100s};

  const auto beats_for = [&](std::chrono::nanoseconds duration) {
    for (const auto end = now + duration; now < end;) link_->beat(now += 100ms);
  };

  beats_for(1100ms);
  EXPECT_TRUE(link_->answers());
  beats_for(100ms);
  EXPECT_TRUE(link_->connected());
  EXPECT_FALSE(link_->answers());
  EXPECT_STREQ(link_->state(), "does not answer");
  ASSERT_EQ(::send(hung.fd, "", 1, 0), 1);
  link_->poll();
  beats_for(1s);
  EXPECT_TRUE(link_->answers());
  now += 10s;  // abbed was stopped
  beats_for(100ms);
  EXPECT_TRUE(link_->answers());
  beats_for(2s);
  EXPECT_FALSE(link_->answers());
  const FarEnd next(path_);
  link_->poll();
  EXPECT_STREQ(link_->state(), "connected");
}

TEST_F(DdsLinkTest, AcceptsFewConnectionsPerCycleAndAllEventually) {
  std::vector<std::unique_ptr<FarEnd>> newcomers;
  for (int i = 0; i < 10; ++i) newcomers.push_back(std::make_unique<FarEnd>(path_));
  link_->poll();
  EXPECT_LT(link_->counters().connections, 10u);
  for (int i = 0; i < 10; ++i) link_->poll();
  EXPECT_EQ(link_->counters().connections, 10u);
}

TEST_F(DdsLinkTest, HandsOverThePayloadUnchanged) {
  FarEnd far(path_);
  link_->poll();
  const auto payload = snapshot_payload(5);
  link_->publish(Topic::Snapshot, payload);
  const auto seen = far.take();
  ASSERT_EQ(seen.size(), 1u);
  EXPECT_EQ(seen[0].topic, static_cast<int>(Topic::Snapshot));
  EXPECT_EQ(seen[0].payload, payload);
}

TEST_F(DdsLinkTest, ALateSubscriberGetsTheNewestOfEveryDurableKey) {
  link_->publish(Topic::ModelState, state_payload("a", 1));
  link_->publish(Topic::ModelState, state_payload("b", 2));
  link_->publish(Topic::ModelState, state_payload("a", 3));
  FarEnd far(path_);
  link_->poll();
  const auto seen = far.take();
  ASSERT_EQ(seen.size(), 2u);
  EXPECT_EQ(seen[0].payload, state_payload("b", 2));
  EXPECT_EQ(seen[1].payload, state_payload("a", 3));
}

TEST_F(DdsLinkTest, ALateSubscriberGetsNoSlicesOfALargerEarlierGrid) {
  for (std::uint32_t i = 0; i < 3; ++i) link_->publish(Topic::ErrorGrid, slice_payload("a", i, 3));
  link_->publish(Topic::ErrorGrid, slice_payload("b", 2, 3));
  link_->publish(Topic::ErrorGrid, slice_payload("a", 0, 1));
  FarEnd far(path_);
  link_->poll();
  const auto seen = far.take();
  ASSERT_EQ(seen.size(), 2u);
  EXPECT_EQ(seen[0].payload, slice_payload("b", 2, 3));
  EXPECT_EQ(seen[1].payload, slice_payload("a", 0, 1));
}

TEST_F(DdsLinkTest, DurableTopicsAreSentAgainAfterAReconnection) {
  link_->publish(Topic::ModelState, state_payload("a", 1));
  for (int i = 0; i < 2; ++i) {
    FarEnd far(path_);
    link_->poll();
    EXPECT_EQ(far.take().size(), 1u) << "connection " << i;
  }
  EXPECT_EQ(link_->counters().connections, 2u);
}

TEST_F(DdsLinkTest, LiveSamplesWithoutListenerAreDroppedAndCounted) {
  link_->publish(Topic::Snapshot, snapshot_payload(1));
  EXPECT_EQ(link_->counters().dropped_live, 1u);
  FarEnd far(path_);
  link_->poll();
  EXPECT_TRUE(far.take().empty());
}

TEST_F(DdsLinkTest, NeverBlocksOnAPeerThatDoesNotReadAndKeepsWhatIsDurable) {
  FarEnd far(path_);
  link_->poll();
  std::uint64_t n = 0;
  while (link_->counters().dropped_live == 0)
    link_->publish(Topic::Snapshot, snapshot_payload(++n));
  link_->publish(Topic::ModelState, state_payload("a", 7));
  bool state_came = false;
  for (int turn = 0; turn < 3; ++turn) {
    for (const auto& frame : far.take()) state_came |= frame.payload == state_payload("a", 7);
    link_->poll();
  }
  EXPECT_TRUE(state_came);
}

/// Sends live samples until the socket is full and `surplus` of them were dropped.
std::uint64_t fill(DdsLink& link, std::uint64_t surplus) {
  std::uint64_t n = 0;
  while (link.counters().dropped_live < surplus)
    link.publish(Topic::Snapshot, snapshot_payload(++n));
  return n;
}

std::vector<FarEnd::Seen> drain(DdsLink& link, FarEnd& far) {
  std::vector<FarEnd::Seen> all;
  for (int i = 0; i < 3; ++i) {
    for (auto& frame : far.take()) all.push_back(std::move(frame));
    link.poll();
  }
  return all;
}

TEST_F(DdsLinkTest, FullSocketDropsTheOldestLiveSampleAndKeepsTheNewest) {
  FarEnd far(path_);
  link_->poll();
  const std::uint64_t newest = fill(*link_, 10);
  const auto seen = messages<v1::Snapshot>(drain(*link_, far), Topic::Snapshot);
  ASSERT_FALSE(seen.empty());
  EXPECT_EQ(seen.back().sequence_number(), newest);
  EXPECT_EQ(seen.size() + link_->counters().dropped_live, newest);
}

TEST_F(DdsLinkTest, FramesCarryTheInstantTheyWerePublished) {
  FarEnd far(path_);
  link_->poll();
  link_->publish(Topic::Snapshot, snapshot_payload(1), DdsLink::WallTime{17ms});
  link_->beat(DdsLink::WallTime{18s});
  const auto seen = far.take();
  ASSERT_EQ(seen.size(), 2u);
  EXPECT_EQ(seen[0].at, 17ms);
  EXPECT_EQ(seen[1].at, 18s);
}

// Otherwise abbe-dds would take the earlier state for abbed's present one.
TEST_F(DdsLinkTest, ABeatDoesNotOvertakeAState) {
  FarEnd far(path_);
  link_->poll();
  fill(*link_, 1);
  link_->publish(Topic::ModelState, state_payload("a", 7));
  bool state_came = false;
  for (auto now = DdsLink::WallTime{100s}; !state_came; now += 100ms) {
    link_->beat(now);
    for (const auto& frame : far.take()) {
      EXPECT_TRUE(frame.kind != 0 || state_came);
      state_came |= frame.topic == static_cast<int>(Topic::ModelState) && frame.kind == 1;
    }
  }
}

TEST_F(DdsLinkTest, BeatsEvery100MillisecondsHoweverOftenItIsCalled) {
  FarEnd far(path_);
  link_->poll();
  const DdsLink::WallTime start{100s};
  for (auto t = 0ms; t < 1000ms; t += 1ms) link_->beat(start + t);
  EXPECT_EQ(far.take().size(), 10u);
}

TEST_F(DdsLinkTest, DetectsThatThePeerDisconnected) {
  {
    FarEnd far(path_);
    link_->poll();
    EXPECT_TRUE(link_->connected());
  }
  link_->poll();
  EXPECT_FALSE(link_->connected());
}

/// Another process connects to `path` and holds the connection until it is killed.
class OtherProcess {
 public:
  explicit OtherProcess(const std::filesystem::path& path) : pid_(::fork()) {
    if (pid_ != 0) return;
    const FarEnd far(path);
    ::pause();
  }
  ~OtherProcess() {
    ::kill(pid_, SIGKILL);
    ::waitpid(pid_, nullptr, 0);
  }
  OtherProcess(const OtherProcess&) = delete;
  OtherProcess& operator=(const OtherProcess&) = delete;

 private:
  pid_t pid_;
};

TEST_F(DdsLinkTest, OnlyTheSupervisedProcessMayConnect) {
  DdsProcess process;
  process.started(::getpid(), DdsLink::WallTime{1s});
  const auto socket = directory_ / "supervised.sock";
  auto link = DdsLink::listen(socket, {.process = &process});

  ASSERT_TRUE(link.has_value());
  FarEnd far(socket);
  link->poll();
  ASSERT_TRUE(link->connected());
  const OtherProcess other(socket);
  while (link->counters().foreign_connections == 0) link->poll();
  EXPECT_EQ(link->counters().connections, 1u);
  link->publish(Topic::Snapshot, snapshot_payload(1));
  EXPECT_EQ(far.take().size(), 1u);
}

TEST_F(DdsLinkTest, AnAnswerShowsThatThePeerReads) {
  DdsProcess process;
  process.started(::getpid(), DdsLink::WallTime{1ns});
  const auto socket = directory_ / "supervised.sock";
  auto link = DdsLink::listen(socket, {.process = &process});

  ASSERT_TRUE(link.has_value());
  const FarEnd far(socket);
  link->poll();
  link->beat(DdsLink::WallTime::clock::now());
  EXPECT_FALSE(process.has_answered());
  ASSERT_EQ(::send(far.fd, "", 1, 0), 1);
  link->poll();
  EXPECT_TRUE(process.has_answered());
  EXPECT_TRUE(link->connected());
}

TEST_F(DdsLinkTest, RefusesBytesThatAreNoPayload) {
  link_->publish(Topic::ModelState, std::vector<std::byte>(64));
  EXPECT_EQ(link_->counters().refused, 1u);
}

TEST_F(DdsLinkTest, SocketFileIsAccessibleToItsOwnerOnly) {
  struct stat file {};
  ASSERT_EQ(::stat(path_.c_str(), &file), 0);
  EXPECT_EQ(file.st_mode & 0777, 0660u);
}

TEST_F(DdsLinkTest, AGroupThatCannotBeSetIsAFaultThatARestartMayRepair) {
  const Account mine{::geteuid(), ::getegid()};
  EXPECT_TRUE(DdsLink::listen(directory_ / "mine.sock", {.user = mine}).has_value());
  if (::geteuid() == 0) GTEST_SKIP() << "root may give a file to any group";
  const Account foreign{::geteuid(), gid_t{54'321}};
  const auto refused = DdsLink::listen(directory_ / "foreign.sock", {.user = foreign});
  ASSERT_FALSE(refused.has_value());
  EXPECT_EQ(refused.error().code, ErrorCode::Io);
  EXPECT_THAT(refused.error().text, testing::HasSubstr("set [dds] socket to"));
}

TEST_F(DdsLinkTest, RefusesAPathThatARunningProcessServes) {
  const auto second = DdsLink::listen(path_);
  ASSERT_FALSE(second.has_value());
  EXPECT_THAT(second.error().text, testing::HasSubstr("already answers there"));
}

TEST_F(DdsLinkTest, ReplacesTheSocketFileOfAnEndedProcess) {
  const auto stale = directory_ / "stale.sock";
  sockaddr_un address{};
  address.sun_family = AF_UNIX;
  stale.string().copy(address.sun_path, sizeof(address.sun_path) - 1);
  const int fd = ::socket(AF_UNIX, SOCK_STREAM, 0);
  ASSERT_EQ(::bind(fd, reinterpret_cast<const sockaddr*>(&address), sizeof(address)), 0);
  ::close(fd);
  EXPECT_TRUE(DdsLink::listen(stale).has_value());
}

}  // namespace
}  // namespace abbe::daemon
