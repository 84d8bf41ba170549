// Two machines with one name on a domain, each with its own abbe-dds: both notice the other, and a
// subscriber uses one of them only.
#include <cstdlib>

#include "shop_floor.hpp"

namespace abbe::test {
namespace {

using namespace std::chrono_literals;

constexpr const char* kTwinId = "b6f4f9a0-51c5-4b0e-9a53-0a6a0f6b7a22";

class Twins : public ShopFloor {
 protected:
  /// Another abbed and abbe-dds of the same name.
  [[nodiscard]] std::unique_ptr<Process> twin(const char* machine_id) {
    const auto folder = directory_ / "twin";
    std::filesystem::create_directory(folder);
    ::setenv("ABBE_FEEDER_MACHINE_ID", machine_id, 1);
    auto started =
        std::make_unique<Process>(feeder_command(folder, kMachine, domain_.text(), profile_, {}));
    ::unsetenv("ABBE_FEEDER_MACHINE_ID");
    return started;
  }
};

TEST_F(Twins, BothReportTheOtherUntilItEnds) {
  start_feeder();
  auto other = twin(kTwinId);
  const auto seen = feeder_->wait_for("twin the same name, machine_id b6f4f9a0");
  EXPECT_TRUE(seen) << feeder_->transcript();
  EXPECT_TRUE(other->wait_for("twin the same name, machine_id 7c1d5a52")) << other->transcript();
  other.reset();
  EXPECT_TRUE(feeder_->wait_for("twin none", seen->came)) << feeder_->transcript();
}

TEST_F(Twins, ACopiedIdentityIsReportedUnderAnyName) {
  start_feeder();
  ::setenv("ABBE_FEEDER_MACHINE_ID", kMachineId, 1);
  const auto copy = feeder_of("vmc-4");
  ::unsetenv("ABBE_FEEDER_MACHINE_ID");
  EXPECT_TRUE(feeder_->wait_for("twin the same machine_id, as machine vmc-4"))
      << feeder_->transcript();
  EXPECT_TRUE(copy->wait_for("twin the same machine_id, as machine vmc-3")) << copy->transcript();
}

/// An abbe-dds of before the topic Identity: it is used by its name unless an identity was given.
TEST_F(Twins, APublisherOfAnEarlierVersionIsUsedByItsName) {
  const auto earlier = twin("none");
  Process fast(fast_subscriber()), cyclone(cyclone_subscriber());
  Process linuxcnc({ABBE_LINUXCNC_SUBSCRIBER, domain_.text(), kMachine});
  Process given({ABBE_LINUXCNC_SUBSCRIBER, domain_.text(), kMachine, kMachineId});
  Process watcher(watch({"--machine", kMachine}));
  for (Process* each : {&fast, &cyclone}) {
    EXPECT_TRUE(each->wait_for("vmc-3: apply V")) << each->transcript();
    EXPECT_NE(each->transcript().find("earlier version without identity"), std::string::npos);
  }
  EXPECT_TRUE(linuxcnc.wait_for("usable ")) << linuxcnc.transcript();
  EXPECT_TRUE(watcher.wait_for("vmc-3  publisher")) << watcher.transcript();
  EXPECT_FALSE(given.wait_for("usable ", {}, 1s)) << given.transcript();
}

/// A stranger that publishes ever new machines does not hide a twin.
TEST_F(Twins, IsReportedBesideTheClaimsOfStrangers) {
  start_feeder();
  Process strangers({ABBE_HOSTILE_PEER, domain_.text(), "1", "claims"});
  ASSERT_TRUE(strangers.wait_for("claimed 8"));
  const auto other = twin(kTwinId);
  EXPECT_TRUE(feeder_->wait_for("twin the same name, machine_id b6f4f9a0"))
      << feeder_->transcript();
}

/// A copied disk: nothing shows which of the two is the machine.
TEST_F(Twins, OfTwoWithOneIdentityALateSubscriberUsesNone) {
  start_feeder();
  const auto copy = twin(kMachineId);
  for (Process* each : {feeder_.get(), copy.get()})
    ASSERT_TRUE(each->wait_for("twin the same machine_id")) << each->transcript();
  const auto given = [](std::vector<std::string> command) {
    for (const char* word : {"--machine", kMachine, kMachineId}) command.emplace_back(word);
    return command;
  };
  Process fast(given(fast_subscriber())), cyclone(given(cyclone_subscriber()));
  Process linuxcnc({ABBE_LINUXCNC_SUBSCRIBER, domain_.text(), kMachine, kMachineId});
  for (Process* each : {&fast, &cyclone}) {
    EXPECT_TRUE(each->wait_for("vmc-3: one of several with one identity")) << each->transcript();
    EXPECT_FALSE(each->wait_for("vmc-3: publisher is", {}, 0s)) << each->transcript();
  }
  EXPECT_TRUE(linuxcnc.wait_for("not usable: nothing received about machine \"vmc-3\": several"))
      << linuxcnc.transcript();
  Process watcher(watch(
      {"--machine", kMachine, "--machine-id", kMachineId, "--until-model", "--timeout-s", "3"}));
  EXPECT_EQ(watcher.wait_for_end(), 1) << watcher.transcript();
}

TEST_F(Twins, ASubscriberNeverChangesFromOneToTheOther) {
  start_feeder();
  Process fast(fast_subscriber()), cyclone(cyclone_subscriber());
  Process linuxcnc({ABBE_LINUXCNC_SUBSCRIBER, domain_.text(), kMachine});
  for (Process* each : {&fast, &cyclone})
    ASSERT_TRUE(each->wait_for("vmc-3: apply V")) << each->transcript();
  ASSERT_TRUE(linuxcnc.wait_for("usable ")) << linuxcnc.transcript();
  const auto other = twin(kTwinId);
  for (Process* each : {&fast, &cyclone})
    EXPECT_TRUE(each->wait_for("vmc-3: another machine of this name")) << each->transcript();

  const auto ended = Clock::now();
  feeder_.reset();
  for (Process* each : {&fast, &cyclone})
    EXPECT_TRUE(each->wait_for("vmc-3: not alive", ended)) << each->transcript();
  const auto silent = Clock::now();
  EXPECT_FALSE(cyclone.wait_for("vmc-3: apply", silent, 13s)) << "10 s and a margin";
  EXPECT_FALSE(fast.wait_for("vmc-3: apply", silent, 0s));
  EXPECT_FALSE(linuxcnc.wait_for("usable ", silent, 0s));
}

TEST_F(Twins, ALateSubscriberUsesTheOneThatItWasGivenAndElseNone) {
  start_feeder();
  const auto other = twin(kTwinId);
  ASSERT_TRUE(feeder_->wait_for("twin the same name"));
  ASSERT_TRUE(other->wait_for("twin the same name"));
  const auto given = [](std::vector<std::string> command) {
    for (const char* word : {"--machine", kMachine, kTwinId}) command.emplace_back(word);
    return command;
  };

  Process fast(fast_subscriber()), cyclone(cyclone_subscriber());
  Process fast_given(given(fast_subscriber())), cyclone_given(given(cyclone_subscriber()));
  for (Process* each : {&fast_given, &cyclone_given})
    EXPECT_TRUE(each->wait_for("vmc-3: apply V")) << each->transcript();
  for (Process* each : {&fast, &cyclone}) {
    EXPECT_TRUE(each->wait_for("vmc-3: one of several machines of this name"))
        << each->transcript();
    EXPECT_FALSE(each->wait_for("vmc-3: publisher is", {}, 0s)) << each->transcript();
  }
  Process watcher(watch(
      {"--machine", kMachine, "--machine-id", kTwinId, "--until-model", "--timeout-s", "20"}));
  EXPECT_EQ(watcher.wait_for_end(), 0) << watcher.transcript();
  Process undecided(watch({"--machine", kMachine, "--until-model", "--timeout-s", "3"}));
  EXPECT_EQ(undecided.wait_for_end(), 1) << undecided.transcript();
}

}  // namespace
}  // namespace abbe::test
