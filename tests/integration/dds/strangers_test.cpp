// Foreign participants on the domain: one publishes fakes, one announces types, one sends malformed
// packets, one reads without keys. Each is a process of its own.
#include <signal.h>

#include <algorithm>
#include <array>
#include <cmath>
#include <cstdio>
#include <cstdlib>
#include <fstream>
#include <nlohmann/json.hpp>

#include "shop_floor.hpp"

namespace abbe::test {
namespace {

using namespace std::chrono_literals;

constexpr const char* kFake = " 999.000 999.000";  // y and z: x of the feeder is its clock

/// How long the foreign participants act; `scripts/soak strangers` asks for more.
std::string stranger_seconds() {
  const char* const asked = std::getenv("ABBE_STRANGERS_SECONDS");
  return asked != nullptr ? asked : "3";
}

class Strangers : public ShopFloor {
 protected:
  [[nodiscard]] std::vector<std::string> stranger(const std::string& what,
                                                  const std::string& keys = {}) const {
    std::vector<std::string> command{ABBE_DDS_STRANGER, domain_.text(), what};
    if (!keys.empty()) command.push_back(keys);
    return command;
  }
  /// How often abbe-dds was started so far.
  [[nodiscard]] long starts() {
    const auto lines = feeder_->lines();
    return std::ranges::count_if(lines, [](const Line& line) {
      return line.text.starts_with("child ") && line.text != "child 0";
    });
  }
  static bool has_fake(Process& subscriber) {
    return subscriber.transcript().find(kFake) != std::string::npos;
  }
};

/// What a watcher printed of the vectors.
struct Vectors {
  long seen = 0;
  long overwritten = 0;  ///< or lost: it keeps the last vector only
  Clock::duration longest_gap{};
};

/// The feeder counts every message, so at most three of its own come between two vectors.
Vectors vectors_of(Process& watch) {
  constexpr std::int64_t kBetweenTwo = 3;
  Vectors vectors;
  std::int64_t last = 0;
  Clock::time_point came{};
  for (const Line& line : watch.lines()) {
    if (!line.text.starts_with(R"({"topic":"abbe/v1/Compensation")")) continue;
    const std::int64_t now = nlohmann::json::parse(line.text)["sequence_number"];
    if (vectors.seen > 0) vectors.longest_gap = std::max(vectors.longest_gap, line.came - came);
    if (last != 0 && now > last + kBetweenTwo) vectors.overwritten += (now - last) / 2 - 1;
    last = now;
    came = line.came;
    ++vectors.seen;
  }
  return vectors;
}

struct VectorCount {
  long seen = 0, lost = 0;
};

/// As its last line has it.
VectorCount counted_by(Process& counter) {
  VectorCount count;
  for (const Line& line : counter.lines())
    std::sscanf(line.text.c_str(), "vectors %ld %ld", &count.seen, &count.lost);
  return count;
}

class StrangersWithSecurity : public Strangers {
 protected:
  /// On a busy computer a message of authentication may be lost. Cyclone DDS does not send its last
  /// one again before the lease of the participant, 40 s, has ended.
  static constexpr std::chrono::seconds kHandshake{90};

  void SetUp() override { start_feeder({"--security", keys}); }
  std::vector<std::string> with_keys(std::vector<std::string> command, std::string folder) const {
    command.push_back(std::move(folder));
    return command;
  }

  const std::string seconds = stranger_seconds();
  std::string keys = make_keys("keys");
  Process fast{with_keys(fast_subscriber(), keys + "/subscriber-1")};
  Process cyclone{with_keys(cyclone_subscriber(), keys + "/subscriber-2")};
  Process watcher{watch({"--json", "--security", keys})};
};

TEST_F(StrangersWithSecurity, FakesAreIgnoredNoProcessEndsNothingIsLost) {
  for (Process* subscriber : {&fast, &cyclone})
    ASSERT_TRUE(subscriber->wait_for("vmc-3: apply V", {}, kHandshake)) << subscriber->transcript();
  ASSERT_TRUE(watcher.wait_for(R"({"topic":"abbe/v1/Compensation")", {}, kHandshake));
  Process counter({ABBE_VECTOR_COUNTER, domain_.text(), keys + "/subscriber-1"});
  ASSERT_TRUE(counter.wait_for("vectors ", {}, kHandshake));
  {
    Process fake(stranger("fake"));
    Process rogue(stranger("fake", make_keys("rogue")));
    Process types(stranger("types"));
    Process garbage(stranger("garbage"));
    Process reader(watch({"--until-model", "--timeout-s", seconds}));
    Process rogue_reader(
        watch({"--until-model", "--timeout-s", seconds, "--security", directory_ / "rogue"}));
    for (Process* stranger : {&fake, &rogue, &types, &garbage})
      EXPECT_TRUE(stranger->wait_for("started"));
    const auto patience = std::chrono::seconds{20 + std::stoi(seconds)};
    EXPECT_EQ(reader.wait_for_end(patience), 1) << "a model was read without keys";
    EXPECT_EQ(rogue_reader.wait_for_end(patience), 1)
        << "a model was read with keys of another authority";
  }
  for (Process* subscriber : {&fast, &cyclone}) {
    EXPECT_TRUE(subscriber->wait_for("vmc-3: apply V", Clock::now())) << subscriber->transcript();
    EXPECT_FALSE(has_fake(*subscriber));
  }
  EXPECT_EQ(watcher.transcript().find("0.000999,0.000999"), std::string::npos);
  EXPECT_EQ(starts(), 1);
  const Vectors vectors = vectors_of(watcher);
  const double gap_ms = milliseconds(vectors.longest_gap);
  const VectorCount counted = counted_by(counter);
  std::printf(
      "figure: strangers with security: believed 0, deaths %ld, vectors lost %ld of %ld; a watcher "
      "that "
      "keeps "
      "the last one missed %ld of %ld, longest gap %.0f ms\n",
      starts() - 1, counted.lost, counted.seen + counted.lost, vectors.overwritten,
      vectors.seen + vectors.overwritten, gap_ms);
  EXPECT_GT(counted.seen, 0);
  // On a computer busy with other things abbe-dds discards vectors that waited, with and without
  // foreign participants.
  if (std::getenv("ABBE_STRANGERS_SECONDS") != nullptr) {
    EXPECT_EQ(counted.lost, 0);
  }
  EXPECT_LT(gap_ms, 1000.0);
}

/// Messages of authentication come before any key is checked.
TEST_F(StrangersWithSecurity, TokensWithoutEndEndNoProcess) {
  ASSERT_TRUE(watcher.wait_for(R"({"topic":"abbe/v1/Compensation")", {}, kHandshake));
  ASSERT_TRUE(fast.wait_for("vmc-3: apply V", {}, kHandshake)) << fast.transcript();
  {
    Process hostile({ABBE_HOSTILE_PEER, domain_.text(), "1", "tokens"});
    for (int n = 0; n < 4; ++n) ASSERT_TRUE(hostile.wait_for("sent ", Clock::now()));
  }
  EXPECT_TRUE(fast.wait_for("vmc-3: apply V", Clock::now())) << fast.transcript();
  EXPECT_TRUE(watcher.wait_for(R"({"topic":"abbe/v1/Compensation")", Clock::now()))
      << watcher.transcript();
  EXPECT_EQ(starts(), 1) << "abbe-dds was started again";
}

/// Fast DDS 2.9 takes an unsigned sample as that of the writer whose GUID it states, and every
/// participant announces its GUID in clear.
TEST_F(StrangersWithSecurity, UnsignedSamplesWithTheGuidOfAWriterAreIgnored) {
  ASSERT_TRUE(watcher.wait_for(R"({"topic":"abbe/v1/Compensation")", {}, kHandshake));
  for (Process* subscriber : {&fast, &cyclone})
    ASSERT_TRUE(subscriber->wait_for("vmc-3: apply V", {}, kHandshake)) << subscriber->transcript();
  {
    Process hostile({ABBE_HOSTILE_PEER, domain_.text(), "1", "forged"});
    for (int n = 0; n < 10; ++n) ASSERT_TRUE(hostile.wait_for("sent ", Clock::now()));
  }
  for (Process* subscriber : {&fast, &cyclone}) {
    EXPECT_TRUE(subscriber->wait_for("vmc-3: apply V", Clock::now())) << subscriber->transcript();
    EXPECT_FALSE(has_fake(*subscriber)) << "a forged vector was applied";
  }
  EXPECT_EQ(watcher.transcript().find("0.000999,0.000999"), std::string::npos);
  EXPECT_EQ(starts(), 1) << "abbe-dds was started again";
}

/// Cyclone DDS 0.10 ended after the second kill: it got the keys of known writers again and again.
TEST_F(StrangersWithSecurity, BothSubscribersReturnAfterEveryKillOfAbbeDds) {
  for (int kill = 0; kill < 4; ++kill) {
    for (Process* subscriber : {&fast, &cyclone})
      ASSERT_TRUE(subscriber->wait_for("vmc-3: apply V", Clock::now(), kHandshake))
          << "before kill " << kill + 1 << "\n"
          << subscriber->transcript();
    EXPECT_FALSE(cyclone.wait_for("nothing", Clock::now(), 2s));  // time for announcements
    const auto killed = Clock::now();
    ::kill(abbe_dds_pid(), SIGKILL);
    for (Process* subscriber : {&fast, &cyclone})
      ASSERT_TRUE(subscriber->wait_for("vmc-3: publisher is ", killed, kHandshake))
          << "after kill " << kill + 1 << "\n"
          << subscriber->transcript();
  }
}

/// Without keys: vmc-3 with all three subscribers, which apply what it publishes.
class StrangersWithoutSecurity : public Strangers {
 protected:
  void SetUp() override {
    start_feeder();
    for (Process* subscriber : {&fast, &cyclone})
      ASSERT_TRUE(subscriber->wait_for("vmc-3: apply V")) << subscriber->transcript();
    ASSERT_TRUE(watcher.wait_for("vmc-3  publisher is alive")) << watcher.transcript();
  }
  void expect_foreign_publisher_reported() {
    for (Process* subscriber : {&fast, &cyclone})
      EXPECT_TRUE(subscriber->wait_for("vmc-3: another publisher ")) << subscriber->transcript();
    const auto line = watcher.wait_for("vmc-3  another publisher ");
    ASSERT_TRUE(line) << watcher.transcript();
    EXPECT_NE(line->text.find(", announced at 127.0.0.1"), std::string::npos) << line->text;
  }
  void expect_no_fake() {
    for (Process* subscriber : {&fast, &cyclone}) EXPECT_FALSE(has_fake(*subscriber));
    EXPECT_EQ(watcher.transcript().find("+999.00"), std::string::npos) << watcher.transcript();
  }

  Process fast{fast_subscriber()};
  Process cyclone{cyclone_subscriber()};
  Process linuxcnc{{ABBE_LINUXCNC_SUBSCRIBER, domain_.text(), kMachine}};
  Process watcher{watch({})};
};

TEST_F(StrangersWithoutSecurity, FakesOfALaterPublisherAreIgnoredAndReported) {
  Process fake(stranger("fake"));
  expect_foreign_publisher_reported();
  const auto reported = Clock::now();
  for (Process* subscriber : {&fast, &cyclone})
    EXPECT_TRUE(subscriber->wait_for("vmc-3: apply V", reported)) << subscriber->transcript();
  expect_no_fake();
}

/// The successor never sent beside the one before; the foreign did.
TEST_F(StrangersWithoutSecurity, AForeignPublisherDoesNotReplaceARestartedOne) {
  Process fake(stranger("fake"));
  expect_foreign_publisher_reported();
  const auto killed = Clock::now();
  ::kill(abbe_dds_pid(), SIGKILL);

  for (Process* subscriber : {&fast, &cyclone}) {
    const auto next = subscriber->wait_for("vmc-3: publisher is ", killed);
    ASSERT_TRUE(next) << subscriber->transcript();
    EXPECT_TRUE(subscriber->wait_for("vmc-3: apply V", next->came)) << subscriber->transcript();
    std::printf("  next publisher after %.0f ms\n",
                std::chrono::duration<double, std::milli>(next->came - killed).count());
  }

  EXPECT_TRUE(watcher.wait_for("vmc-3  publisher is now ", killed)) << watcher.transcript();
  expect_no_fake();
}

/// As before identities were pinned: it would have been used 10 s after the end of the first.
TEST_F(StrangersWithoutSecurity, AMachineOfTheSameNameIsNotUsedAfterTheFirstEnds) {
  Process twin(stranger("twin"));
  for (Process* subscriber : {&fast, &cyclone})
    EXPECT_TRUE(subscriber->wait_for("vmc-3: another machine of this name"))
        << subscriber->transcript();
  EXPECT_TRUE(watcher.wait_for("vmc-3  another machine of this name, machine_id b6f4f9a0"))
      << watcher.transcript();

  const auto ended = Clock::now();
  feeder_.reset();
  for (Process* subscriber : {&fast, &cyclone})
    ASSERT_TRUE(subscriber->wait_for("vmc-3: not alive", ended)) << subscriber->transcript();
  EXPECT_FALSE(cyclone.wait_for("vmc-3: publisher is", ended, 13s));  // 10 s and a margin
  EXPECT_FALSE(fast.wait_for("vmc-3: publisher is", ended, 0s));
  EXPECT_TRUE(linuxcnc.wait_for("not usable: ", ended)) << linuxcnc.transcript();
  EXPECT_FALSE(linuxcnc.wait_for("usable ", ended, 0s)) << linuxcnc.transcript();
  expect_no_fake();

  const auto back = Clock::now();
  start_feeder();
  for (Process* subscriber : {&fast, &cyclone})
    EXPECT_TRUE(subscriber->wait_for("vmc-3: apply V", back)) << subscriber->transcript();
  EXPECT_TRUE(linuxcnc.wait_for("usable ", back)) << linuxcnc.transcript();
  expect_no_fake();
}

/// A copied disk: the same machine_id from two participants.
TEST_F(StrangersWithoutSecurity, ACopyOfTheIdentityIsNotUsedAfterTheFirstEnds) {
  Process fake(stranger("fake"));
  expect_foreign_publisher_reported();
  const auto ended = Clock::now();
  feeder_.reset();
  EXPECT_FALSE(cyclone.wait_for("vmc-3: publisher is", ended, 13s));
  EXPECT_FALSE(fast.wait_for("vmc-3: publisher is", ended, 0s));
  expect_no_fake();
}

/// Without keys, with a watcher that prints every vector.
class UninvitedWithoutSecurity : public Strangers {
 protected:
  void SetUp() override {
    start_feeder();
    for (Process* subscriber : {&fast, &cyclone})
      ASSERT_TRUE(subscriber->wait_for("vmc-3: apply V")) << subscriber->transcript();
    ASSERT_TRUE(watcher.wait_for(R"({"topic":"abbe/v1/Compensation")"));
  }
  /// While `what` acts for three seconds (discovery takes up to one) and after it.
  void expect_nothing_ends_and_no_gap_of_half_a_second(const char* what) {
    {
      Process uninvited(stranger(what));
      ASSERT_TRUE(uninvited.wait_for("started"));
      EXPECT_FALSE(feeder_->wait_for("child", Clock::now(), 3s)) << "abbe-dds was started again";
    }
    for (Process* subscriber : {&fast, &cyclone})
      EXPECT_TRUE(subscriber->wait_for("vmc-3: apply V", Clock::now())) << subscriber->transcript();
    ASSERT_TRUE(watcher.wait_for(R"({"topic":"abbe/v1/Compensation")", Clock::now()));
    const Vectors vectors = vectors_of(watcher);
    const double gap_ms = milliseconds(vectors.longest_gap);
    std::printf("figure: %s without security: longest gap %.0f ms of %ld vectors\n", what, gap_ms,
                vectors.seen);
    EXPECT_GT(vectors.seen, 100);
    EXPECT_LT(gap_ms, 500.0);
  }

  Process fast{fast_subscriber()};
  Process cyclone{cyclone_subscriber()};
  Process watcher{watch({"--json"})};
};

TEST_F(UninvitedWithoutSecurity, AnnouncedTypesEndNothingAndMakeNoGap) {
  expect_nothing_ends_and_no_gap_of_half_a_second("types");
}

TEST_F(UninvitedWithoutSecurity, GarbageEndsNothingAndMakesNoGap) {
  expect_nothing_ends_and_no_gap_of_half_a_second("garbage");
}

TEST_F(UninvitedWithoutSecurity, DisposedInstancesEndNothingAndMakeNoGap) {
  expect_nothing_ends_and_no_gap_of_half_a_second("dispose");
}

/// The watcher has model and grid of vmc-3 and waits for its state; the foreign state is ACTIVE
/// and the foreign grid has the same model_id.
TEST_F(Strangers, AFakeGridBesideTheTrueOneIsIgnored) {
  ::setenv("ABBE_FEEDER_STALE", "1", 1);
  start_feeder();
  ::unsetenv("ABBE_FEEDER_STALE");
  const auto csv = directory_ / "grid.csv";
  Process watcher(watch({"--grid-csv", csv, "--timeout-s", "30"}));
  ASSERT_TRUE(watcher.wait_for("vmc-3  publisher is alive")) << watcher.transcript();
  Process fake(stranger("fake"));
  ASSERT_TRUE(watcher.wait_for("vmc-3  another publisher ")) << watcher.transcript();
  EXPECT_FALSE(watcher.wait_for("nothing", Clock::now(), 2s));  // time for its grid
  EXPECT_FALSE(std::filesystem::exists(csv)) << "the stranger's state was believed";

  feeder_->signal(SIGUSR1);
  ASSERT_EQ(watcher.wait_for_end(), 0) << watcher.transcript();
  std::ifstream written(csv);
  std::string line;
  std::size_t nodes = 0;
  for (std::getline(written, line); std::getline(written, line); ++nodes) {
    std::array<double, 3> error_um{};
    ASSERT_EQ(std::sscanf(line.c_str(), "%*f,%*f,%*f,%lf,%lf,%lf", &error_um[0], &error_um[1],
                          &error_um[2]),
              3)
        << line;
    for (const double e : error_um) EXPECT_LT(std::abs(e), 100.0) << line;
  }
  EXPECT_EQ(nodes, kNodesPerAxis * kNodesPerAxis * kNodesPerAxis);
}

TEST_F(Strangers, WatchReportsThatSecurityIsOff) {
  const std::string log = directory_ / "log";
  Process watcher({"/bin/sh", "-c", "exec \"$@\" 2>&1", "sh", ABBE_WATCH_PROGRAM, "--domain",
                   domain_.text(), "--profile", ABBE_LOOPBACK_PROFILE, "--until-model",
                   "--timeout-s", "0.1"});
  EXPECT_EQ(watcher.wait_for_end(), 1);
  EXPECT_NE(watcher.transcript().find("DDS Security is off: anyone on domain " + domain_.text()),
            std::string::npos);
}

TEST_F(Strangers, MissingKeysEndWithThree) {
  Process program({ABBE_DDS_PROGRAM, "--socket", directory_ / "dds.sock", "--security",
                   directory_ / "nowhere"});
  EXPECT_EQ(program.wait_for_end(), 3);
}

}  // namespace
}  // namespace abbe::test
