#include "abbe/base/journal.hpp"

#include <fmt/format.h>
#include <gmock/gmock.h>
#include <poll.h>
#include <sys/socket.h>
#include <sys/un.h>
#include <unistd.h>

#include <array>
#include <cstring>
#include <stdexcept>
#include <string>

#include "abbe/service/journal_thread.hpp"
#include "recording_fixture.hpp"

namespace abbe::daemon {
namespace {

using namespace std::chrono_literals;
using ::testing::AllOf;
using ::testing::ElementsAre;
using ::testing::HasSubstr;
using ::testing::IsEmpty;
using ::testing::Not;
using ::testing::SizeIs;
using WallTime = StateObserver::WallTime;

/// What systemd-journald listens at.
class FakeJournal {
 public:
  explicit FakeJournal(const std::filesystem::path& path) {
    sockaddr_un address{};
    address.sun_family = AF_UNIX;
    std::strncpy(address.sun_path, path.c_str(), sizeof address.sun_path - 1);
    EXPECT_EQ(::bind(fd_, reinterpret_cast<const sockaddr*>(&address), sizeof address), 0);
  }
  ~FakeJournal() { ::close(fd_); }
  FakeJournal(const FakeJournal&) = delete;
  FakeJournal& operator=(const FakeJournal&) = delete;
  [[nodiscard]] std::string receive() const {
    std::array<char, 65536> buffer{};
    const ssize_t n = ::recv(fd_, buffer.data(), buffer.size(), 0);
    return {buffer.data(), n > 0 ? static_cast<std::size_t>(n) : 0};
  }
  [[nodiscard]] bool waits() const {
    pollfd ready{fd_, POLLIN, 0};
    return ::poll(&ready, 1, 0) > 0;
  }

 private:
  int fd_ = ::socket(AF_UNIX, SOCK_DGRAM, 0);
};

const JournalEntry kEntry{.urgency = Urgency::Warning,
                          .message = "device tracker: connecting; last fault: a\nb",
                          .message_id = "5f0c8a7be4f94c0f9d0e6a3f1b7c2d41",
                          .fields = {{"ABBE_DEVICE", "tracker"}, {"ABBE_STATE", "connecting"}}};

TEST(Journal, SendsFieldsInTheNativeProtocol) {
  const TemporaryFolder folder;
  const FakeJournal journal{folder.path() / "socket"};
  const auto sink = native_journal(folder.path() / "socket");
  ASSERT_TRUE(sink) << sink.error().text;
  (*sink)->write(kEntry);
  const std::string length{"\x2b\0\0\0\0\0\0\0", 8};
  EXPECT_EQ(journal.receive(), "MESSAGE\n" + length +
                                   "device tracker: connecting; last fault: a\nb\n"
                                   "PRIORITY=4\nSYSLOG_IDENTIFIER=abbed\n"
                                   "MESSAGE_ID=5f0c8a7be4f94c0f9d0e6a3f1b7c2d41\n"
                                   "ABBE_DEVICE=tracker\nABBE_STATE=connecting\n");
}

TEST(Journal, AJournalThatDoesNotReadDoesNotBlockAndGetsTheCountOfMissedLines) {
  const TemporaryFolder folder;
  const FakeJournal journal{folder.path() / "socket"};
  const auto sink = native_journal(folder.path() / "socket");

  ASSERT_TRUE(sink) << sink.error().text;
  JournalEntry large = kEntry;
  large.message.assign(60'000, 'x');
  for (int i = 0; i < 20; ++i) (*sink)->write(large);  // more than the kernel keeps for a socket
  int kept = 0;
  while (journal.waits()) kept += journal.receive().empty() ? 0 : 1;
  ASSERT_LT(kept, 20);
  (*sink)->write(kEntry);
  const auto next = journal.receive();
  EXPECT_THAT(next,
              HasSubstr(fmt::format("the journal lost {} entries before this one", 20 - kept)));
  EXPECT_THAT(next, HasSubstr(fmt::format("ABBE_NOT_TAKEN={}\n", 20 - kept)));
  (*sink)->write(kEntry);
  EXPECT_THAT(journal.receive(), Not(HasSubstr("ABBE_NOT_TAKEN")));
}

TEST(Journal, WithoutASocketIsAnError) {
  EXPECT_FALSE(native_journal("/nonexistent/journal"));
}

TEST(Journal, AsTextIsOneLineWithTheSameContent) {
  std::array<int, 2> ends{};
  ASSERT_EQ(::pipe(ends.data()), 0);
  std::FILE* const stream = ::fdopen(ends[1], "w");
  ASSERT_NE(stream, nullptr);
  text_journal(stream)->write(kEntry);
  ASSERT_EQ(std::fclose(stream), 0);
  std::array<char, 1024> buffer{};
  const ssize_t n = ::read(ends[0], buffer.data(), buffer.size());
  ::close(ends[0]);
  EXPECT_EQ((std::string{buffer.data(), static_cast<std::size_t>(std::max<ssize_t>(n, 0))}),
            "abbed: device tracker: connecting; last fault: a\\u{A}b [ABBE_DEVICE=tracker "
            "ABBE_STATE=connecting]\n");
}

class StateObserverTest : public ::testing::Test {
 protected:
  StateObserverTest() {
    now_.streams.resize(1);
    now_.streams[0].status.name = "tracker";
    now_.streams[0].status.state = "connecting";
    now_.model = {.state = "NONE", .id = "", .reason = "no model has been activated"};
    (void)look();
  }
  std::vector<JournalEntry> look(std::chrono::milliseconds later = 250ms) {
    wall_ += later;
    return observer_.look(now_, wall_);
  }
  /// Texts of what is new.
  std::vector<std::string> lines(std::chrono::milliseconds later = 250ms) {
    std::vector<std::string> texts;
    for (const auto& entry : look(later)) texts.push_back(entry.message);
    return texts;
  }
  void tracker(std::string_view state, bool connected, const std::string& fault) {
    auto& status = now_.streams[0].status;
    status.state = state;
    status.connected = connected;
    if (fault != status.last_fault) ++status.faults;
    status.last_fault = fault;
  }

  StateObserver observer_{"mill"};
  Observed now_;
  WallTime wall_{};
};

std::string field(const JournalEntry& entry, const std::string& name) {
  for (const auto& f : entry.fields)
    if (f.name == name) return f.value;
  return "(none)";
}

TEST_F(StateObserverTest, AnUnchangedStateIsNotRepeated) {
  EXPECT_THAT(look(), IsEmpty());
  EXPECT_THAT(look(1h), IsEmpty());
}

TEST_F(StateObserverTest, ARefusedDeviceIsOneWarningWithARemedy) {
  tracker("connecting", false, "connect 10.0.0.7:700: Connection refused");
  const auto entries = look();
  ASSERT_THAT(entries, SizeIs(1));
  EXPECT_EQ(entries[0].urgency, Urgency::Warning);
  EXPECT_THAT(entries[0].message, AllOf(HasSubstr("device tracker: connecting"),
                                        HasSubstr("Connection refused"), HasSubstr("cable")));
  EXPECT_EQ(field(entries[0], "ABBE_MACHINE"), "mill");
  EXPECT_EQ(field(entries[0], "ABBE_DEVICE"), "tracker");
  EXPECT_EQ(field(entries[0], "ABBE_FAULT"), "connect 10.0.0.7:700: Connection refused");
  EXPECT_THAT(look(), IsEmpty());
}

TEST_F(StateObserverTest, AConditionOfAConnectedDeviceIsAWarningAndItsEndALine) {
  tracker("streaming", true, "");
  (void)look();
  now_.streams[0].status.condition = "scale_x is not available (X is missing)";
  const auto entries = look();
  ASSERT_THAT(entries, SizeIs(1));
  EXPECT_EQ(entries[0].urgency, Urgency::Warning);
  EXPECT_THAT(entries[0].message, HasSubstr("streaming; scale_x is not available (X is missing)"));
  EXPECT_EQ(field(entries[0], "ABBE_CONDITION"), "scale_x is not available (X is missing)");
  now_.streams[0].status.condition.clear();
  EXPECT_THAT(lines(), SizeIs(1));
}

TEST_F(StateObserverTest, FaultsThatRepeatAreALineAMinuteWithTheirCount) {
  tracker("streaming", true, "torn packet");
  EXPECT_THAT(lines(), SizeIs(1));
  now_.streams[0].status.faults += 12'889;
  EXPECT_THAT(lines(), IsEmpty());
  EXPECT_THAT(lines(60s), ElementsAre(HasSubstr("12889 faults or lost samples more")));
}

TEST_F(StateObserverTest, ChangesBackAndForthAreLimitedAndOmittedOnesAreCounted) {
  std::size_t logged = 0;
  for (int i = 0; i < 100; ++i) {
    tracker(i % 2 == 0 ? "streaming" : "beam lost", true, "");
    logged += lines(10ms).size();
  }
  EXPECT_LE(logged, 5u);
  const auto entries = look(10s);
  ASSERT_THAT(entries, SizeIs(1));
  const auto left_out = std::stoul(field(entries[0], "ABBE_SUPPRESSED"));
  EXPECT_GE(logged + left_out + 1, 99u);
  EXPECT_LE(logged + left_out, 100u);
}

TEST_F(StateObserverTest, SessionModelRecorderLinkParticipantAndHubAreFollowed) {
  now_.session.id = 3;
  now_.session.state = SessionState::Refused;
  now_.session.reason = "worse than no compensation";

  EXPECT_THAT(lines(),
              ElementsAre(HasSubstr("calibration 3 (otf): refused: worse than no compensation")));
  now_.model = {.state = "ACTIVE", .id = "abcd", .reason = "forced by anna: trial"};
  EXPECT_THAT(lines(), ElementsAre("model abcd: ACTIVE: forced by anna: trial"));
  auto& recorder = now_.streams.emplace_back().status;
  recorder.name = "recorder";
  recorder.state = "disk full";
  recorder.last_fault = "write abbe.mcap: No space left on device";
  const auto full = look();
  ASSERT_THAT(full, SizeIs(1));
  EXPECT_EQ(full[0].urgency, Urgency::Error);
  EXPECT_THAT(full[0].message,
              AllOf(HasSubstr("recorder: disk full"), HasSubstr("[recording] dir")));
  now_.participant = ObservedParticipant{};
  EXPECT_THAT(lines(), ElementsAre("abbe-dds: started"));
  now_.participant->start_fault = "start abbe-dds: No such file or directory";
  now_.participant->last_end = "signal 9 (Killed) at 2026-11-22T16:58:22Z";
  EXPECT_THAT(
      lines(),
      ElementsAre(
          AllOf(HasSubstr("abbe-dds: ended: signal 9 (Killed) at 2026-11-22T16:58:22Z; cannot be "),
                HasSubstr("started again: start abbe-dds: No such file"))));
  now_.participant = ObservedParticipant{
      .restarts = 1,
      .last_end = "it did not answer and was ended by abbed at 2026-11-22T16:58:22Z",
      .start_fault = {}};
  EXPECT_THAT(lines(),
              ElementsAre(HasSubstr("abbe-dds: ended: it did not answer and was ended by abbed at "
                                    "2026-11-22T16:58:22Z; started again, 1 times")));
  now_.hub_answers = false;
  now_.streams.clear();
  EXPECT_THAT(lines(), ElementsAre(HasSubstr("hub: has not answered")));
}

/// No cable helps.
TEST_F(StateObserverTest, DdsSecurityThatIsOffIsNoFaultOfADevice) {
  auto& security = now_.streams.emplace_back().status;
  security.name = "dds_security";
  security.state = "off";
  security.last_fault = "DDS Security is off: make keys with `abbe dds keys`";
  const auto entries = look();
  ASSERT_THAT(entries, SizeIs(1));
  EXPECT_EQ(entries[0].urgency, Urgency::Warning);
  EXPECT_THAT(entries[0].message, AllOf(HasSubstr("dds_security: off"), Not(HasSubstr("device")),
                                        Not(HasSubstr("cable"))));
}

struct KeptEntries final : JournalSink {
  explicit KeptEntries(std::vector<std::string>& out) : kept(out) {}
  void write(const JournalEntry& entry) override { kept.push_back(entry.message); }
  std::vector<std::string>& kept;
};

TEST(JournalThread, ObservesOnceMoreAtItsEndAndContinuesAfterAnInternalError) {
  std::vector<std::string> kept;
  int looks = 0;
  {
    const JournalThread thread{"mill", std::make_unique<KeptEntries>(kept),
                               [&looks]() -> Observed {
                                 if (++looks == 1) throw std::runtime_error{"once"};
                                 return {};
                               },
                               1h};
  }
  EXPECT_GE(looks, 1);
  EXPECT_THAT(kept, ::testing::Contains(HasSubstr("internal error: once")));
}

}  // namespace
}  // namespace abbe::daemon
