/// Replay of a recorded counter card.

#include <gtest/gtest.h>

#include "abbe/protocol/quad08/sequences.hpp"
#include "abbe/protocol/usb/descriptors.hpp"
#include "abbe/sim/recorded_card.hpp"
#include "recording_instants.hpp"

namespace abbe::sim {
namespace {

using namespace std::chrono_literals;
using Outcome = ControlAnswer::Outcome;
namespace usbip = protocol::usbip;

constexpr auto kVersion = quad08::read_firmware_version();
constexpr auto kStatus = quad08::read(quad08::Register::Acquisition);
constexpr auto kStop = quad08::write(quad08::Register::Acquisition, quad08::acquisition::kPacerOff);
constexpr auto kStartPacer = quad08::start_pacer();

using Data = std::vector<std::byte>;
Data word(unsigned low) {
  return {std::byte(low), std::byte{0}};
}

class Tape {
 public:
  Tape& at(std::chrono::nanoseconds since) {
    time = kRecorded + since;
    return *this;
  }
  Tape& ask(const usb::Setup& setup) {
    usbip::Submit request;
    request.head.direction = setup.device_to_host() ? usbip::Direction::In : usbip::Direction::Out;
    request.setup = usb::encode(setup);
    return add(true, usbip::Urb{request}, {});
  }
  Tape& answer(const Data& data = {}) { return add(false, usbip::Urb{usbip::SubmitReply{}}, data); }
  Tape& scans(const Data& data) {
    usbip::SubmitReply reply;
    reply.head.direction = usbip::Direction::In;
    reply.head.endpoint = 2;
    return add(false, usbip::Urb{reply}, data);
  }
  Tape& lose() {
    device.blocks.push_back({time, true, false, {}});
    return *this;
  }
  Tape& open() {
    device.blocks.push_back({time, false, false, {}});
    return ask(kVersion).answer(word(4)).ask(kVersion).answer(word(4));
  }
  RecordedDevice device{"card", RecordedKind::CounterCard, {}};
  HostTime time = kRecorded;

 private:
  Tape& add(bool to_device, const usbip::Urb& urb, const Data& data) {
    const auto head = usbip::encode(urb);
    Data bytes(head.begin(), head.end());
    bytes.insert(bytes.end(), data.begin(), data.end());
    device.blocks.push_back({time, to_device, false, bytes});
    return *this;
  }
};

/// A scan that overruns after 200 ms and is restarted.
Tape overrun() {
  Tape t;
  t.open().ask(kStartPacer).answer();
  t.at(100ms).scans(word(1)).ask(kStatus).answer(word(0x10));
  t.at(200ms).scans(word(2)).ask(kStatus).answer(word(0x14));
  t.at(201ms).ask(kStop).answer().ask(kStartPacer).answer();
  return t.at(300ms).scans(word(3));
}

struct Replayed {
  explicit Replayed(const Tape& tape) : card(tape.device, "S1", timeline, true) {}
  ReplayTimeline timeline;
  RecordedCard card;

  void open() {
    (void)card.answer(kVersion, kReplayed);
    (void)card.answer(kVersion, kReplayed);
  }
  Data at(HostTime now) {
    card.advance(now, 512);
    return card.take(512);
  }
};

TEST(RecordedCard, HasTheDescriptorsOfACardWithTheGivenSerialNumber) {
  Replayed r{overrun()};
  const auto answer = r.card.answer(
      usb::get_descriptor(usb::DescriptorType::String, 3, usb::kMaxDescriptor), kReplayed);
  const auto text = usb::decode_string(answer.data);
  ASSERT_TRUE(text);
  EXPECT_EQ(text->view(), "S1");
}

TEST(RecordedCard, SendsScansWithTheirTimingFromTheStartOfThePacer) {
  Replayed r{overrun()};
  r.open();
  EXPECT_TRUE(r.at(kReplayed + 1s).empty());
  EXPECT_EQ(r.card.answer(kStartPacer, kReplayed).outcome, Outcome::Done);
  EXPECT_EQ(r.card.available_at(2), kReplayed + 100ms);
  EXPECT_TRUE(r.at(kReplayed + 99ms).empty());
  EXPECT_EQ(r.at(kReplayed + 100ms), word(1));
  EXPECT_EQ(r.at(kReplayed + 200ms), word(2));
}

TEST(RecordedCard, ReportsTheRecordedStatusOfTheTime) {
  Replayed r{overrun()};
  r.open();
  (void)r.card.answer(kStartPacer, kReplayed);
  EXPECT_EQ(r.card.answer(kStatus, kReplayed + 50ms).data, word(0x10));
  EXPECT_EQ(r.card.answer(kStatus, kReplayed + 150ms).data, word(0x10));
  EXPECT_EQ(r.card.answer(kStatus, kReplayed + 210ms).data, word(0x14));
}

TEST(RecordedCard, ARecordedRestartContinuesWithTheScansRecordedAfterIt) {
  Replayed r{overrun()};
  r.open();
  (void)r.card.answer(kStartPacer, kReplayed);
  (void)r.at(kReplayed + 200ms);
  EXPECT_EQ(r.card.answer(kStop, kReplayed + 205ms).outcome, Outcome::Done);
  EXPECT_EQ(r.card.answer(kStartPacer, kReplayed + 206ms).outcome, Outcome::Done);
  EXPECT_FALSE(r.card.finished());
  EXPECT_EQ(r.at(kReplayed + 305ms), word(3));
  EXPECT_TRUE(r.card.finished());
}

TEST(RecordedCard, AHostThatRestartsEarlierThanRecordedGetsTheRest) {
  Replayed r{overrun()};
  r.open();
  (void)r.card.answer(kStartPacer, kReplayed);
  EXPECT_EQ(r.at(kReplayed + 100ms), word(1));
  EXPECT_EQ(r.card.answer(kStop, kReplayed + 110ms).outcome, Outcome::Done);
  EXPECT_TRUE(r.at(kReplayed + 250ms).empty());
  EXPECT_EQ(r.card.answer(kStatus, kReplayed + 250ms).data, word(0x10));
  EXPECT_EQ(r.card.answer(kStartPacer, kReplayed + 260ms).outcome, Outcome::Done);
  EXPECT_EQ(r.at(kReplayed + 260ms), word(2));
}

TEST(RecordedCard, DoesNotAnswerWhereTheRecordedCardDidNot) {
  Tape t;
  t.open().ask(kStartPacer).answer().at(100ms).scans(word(1)).ask(kStatus).answer(word(0x10));
  t.at(200ms).ask(kStatus);
  t.at(900ms).open().ask(kStartPacer).answer().at(1s).scans(word(2));
  Replayed r{t};
  r.open();
  (void)r.card.answer(kStartPacer, kReplayed);

  EXPECT_EQ(r.card.answer(kStatus, kReplayed + 150ms).outcome, Outcome::Done);
  EXPECT_EQ(r.card.answer(kStatus, kReplayed + 250ms).outcome, Outcome::Silent);
  r.card.host_disconnected();
  r.open();
  (void)r.card.answer(kStartPacer, kReplayed + 1s);
  EXPECT_EQ(r.at(kReplayed + 1100ms), word(2));
}

TEST(RecordedCard, ARecordedConnectionLossIsRepeated) {
  Tape t;
  t.open().ask(kStartPacer).answer().at(100ms).scans(word(1)).at(150ms).lose();
  t.at(900ms).open().ask(kStartPacer).answer().at(1s).scans(word(2));
  Replayed r{t};
  r.open();
  EXPECT_EQ(r.card.breaks_at(), HostTime::max());
  (void)r.card.answer(kStartPacer, kReplayed);
  EXPECT_EQ(r.card.breaks_at(), kReplayed + 150ms);
  r.card.host_disconnected();
  EXPECT_EQ(r.card.breaks_at(), HostTime::max());
}

}  // namespace
}  // namespace abbe::sim
