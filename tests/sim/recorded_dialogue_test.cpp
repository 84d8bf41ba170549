/// Modbus and I++ DME out of a recording: what was answered then is answered now.

#include <gtest/gtest.h>

#include <string>

#include "abbe/protocol/modbus/read.hpp"
#include "abbe/sim/recorded_dialogue.hpp"

namespace abbe::sim {
namespace {

using namespace std::chrono_literals;
namespace modbus = protocol::modbus;

constexpr HostTime kThen{5000s};
constexpr HostTime kNow{90s};

std::vector<std::byte> bytes(std::string_view text) {
  const auto view = std::as_bytes(std::span{text});
  return {view.begin(), view.end()};
}
std::string text(std::span<const std::byte> bytes) {
  return {reinterpret_cast<const char*>(bytes.data()), bytes.size()};
}

class Script {
 public:
  explicit Script(RecordedKind kind) : device{"device", kind, {}} {}
  Script& connect() { return add(false, {}); }
  Script& lose() { return add(true, {}); }
  Script& ask(std::vector<std::byte> b) { return add(true, std::move(b)); }
  Script& say(std::vector<std::byte> b) { return add(false, std::move(b)); }
  Script& after(std::chrono::nanoseconds d) {
    time += d;
    return *this;
  }
  RecordedDevice device;
  HostTime time = kThen;

 private:
  Script& add(bool to_device, std::vector<std::byte> b) {
    device.blocks.push_back({time, to_device, false, std::move(b)});
    return *this;
  }
};

RecordedDialogue player(const Script& script) {
  return RecordedDialogue{script.device, dialogue_wire(script.device.kind)};
}

std::string said(RecordedDialogue& player, HostTime now) {
  player.advance(now);
  return text(player.take_output());
}
std::string reply(RecordedDialogue& player, std::string_view line, HostTime now = kNow) {
  player.receive(bytes(line), now);
  return said(player, now);
}

Script talk() {
  Script s{RecordedKind::MeasuringMachine};
  s.connect().ask(bytes("00001 Get(X())\r\n")).say(bytes("00001 &\r\n00001 # X(1)\r\n00001 %\r\n"));
  s.ask(bytes("00002 Get(X())\r\n"))
      .say(bytes("00002 &\r\n000"))
      .after(10ms)
      .say(bytes("02 # X(2)\r\n00002 %\r\n"));
  return s;
}

TEST(RecordedDialogue, AnswersTheNthEqualRequestAsThenAndTheLastForEver) {
  auto p = player(talk());
  p.connected(kNow);
  EXPECT_EQ(reply(p, "00001 Get(X())\r\n"), "00001 &\r\n00001 # X(1)\r\n00001 %\r\n");
  p.receive(bytes("00002 Get(X())\r\n"), kNow);
  EXPECT_EQ(said(p, kNow + 10ms), "00002 &\r\n00002 # X(2)\r\n00002 %\r\n");
  EXPECT_TRUE(p.finished());
  p.receive(bytes("00003 Get(X())\r\n"), kNow);
  EXPECT_EQ(said(p, kNow + 10ms), "00003 &\r\n00003 # X(2)\r\n00003 %\r\n");
}

TEST(RecordedDialogue, RenumbersAlsoATornAnswerAndKeepsItsPieces) {
  auto p = player(talk());
  p.connected(kNow);
  reply(p, "00007 Get(X())\r\n");
  EXPECT_EQ(reply(p, "00008 Get(X())\r\n"), "00008 &\r\n000");
  EXPECT_EQ(p.next_due(), kNow + 10ms);
  EXPECT_EQ(said(p, kNow + 10ms), "08 # X(2)\r\n00008 %\r\n");
}

TEST(RecordedDialogue, WaitsForAWholeRequest) {
  auto p = player(talk());
  p.connected(kNow);
  EXPECT_EQ(reply(p, "00001 Get("), "");
  EXPECT_EQ(reply(p, "X())\r\n"), "00001 &\r\n00001 # X(1)\r\n00001 %\r\n");
}

TEST(RecordedDialogue, RefusesWhatNobodyAskedThen) {
  auto p = player(talk());
  p.connected(kNow);
  EXPECT_EQ(
      reply(p, "00001 Home()\r\n"),
      "00001 &\r\n00001 ! Error(2,0501,\"replay\",\"Not asked in the recording\")\r\n00001 %\r\n");
}

TEST(RecordedDialogue, BreaksWhereItBrokeAndGoesOnOnTheNextConnection) {
  Script s{RecordedKind::MeasuringMachine};
  s.connect().ask(bytes("00001 Get(X())\r\n")).after(20ms).lose();
  s.after(1s).connect().ask(bytes("00001 Get(X())\r\n")).say(bytes("00001 # X(3)\r\n"));
  auto p = player(s);
  p.connected(kNow);

  EXPECT_EQ(reply(p, "00001 Get(X())\r\n"), "");
  EXPECT_FALSE(p.wants_close());
  p.advance(kNow + 20ms);
  EXPECT_TRUE(p.wants_close());
  p.disconnected();
  p.connected(kNow + 1s);
  EXPECT_EQ(reply(p, "00001 Get(X())\r\n", kNow + 1s), "00001 # X(3)\r\n");
  p.disconnected();
  p.connected(kNow + 2s);  // the next daemon sees the recording from its start
  EXPECT_EQ(reply(p, "00001 Get(X())\r\n", kNow + 2s), "");
}

TEST(RecordedDialogue, WasSilentWhereTheDeviceWasButNotForBeingCutOff) {
  Script s{RecordedKind::MeasuringMachine};
  s.connect()
      .ask(bytes("00001 Get(X())\r\n"))
      .ask(bytes("00002 Get(X())\r\n"))
      .say(bytes("00002 # X(3)\r\n"));
  s.ask(bytes("00003 Get(X())\r\n"));
  auto p = player(s);
  p.connected(kNow);
  EXPECT_EQ(reply(p, "00001 Get(X())\r\n"), "");
  EXPECT_EQ(reply(p, "00002 Get(X())\r\n"), "00002 # X(3)\r\n");
  EXPECT_EQ(reply(p, "00003 Get(X())\r\n"), "00003 # X(3)\r\n");
}

std::vector<std::byte> request(modbus::Transport transport) {
  std::vector<std::byte> frame(modbus::kMaxAduSize);
  frame.resize(modbus::encode({.unit = 1, .address = 49, .count = 1}, transport, frame));
  return frame;
}

TEST(RecordedDialogue, GivesAModbusAnswerTheNumberOfItsQuestion) {
  const auto asked = request(modbus::Transport::Tcp);
  const std::vector<std::byte> told = bytes({"\0\0\0\0\0\5\1\3\2\0\7", 11});
  auto p = player(Script{RecordedKind::ModbusTcp}.connect().ask(asked).say(told));
  p.connected(kNow);
  auto again = asked;
  again[0] = std::byte{0x12};
  again[1] = std::byte{0x34};
  p.receive(again, kNow);
  p.advance(kNow);
  auto wanted = told;
  wanted[0] = std::byte{0x12};
  wanted[1] = std::byte{0x34};

  EXPECT_EQ(p.take_output(), wanted);
}

TEST(RecordedDialogue, DeclinesAnUnknownReadAsModbusDoes) {
  const auto asked = request(modbus::Transport::Rtu);
  auto p = player(Script{RecordedKind::ModbusRtu}.connect());
  p.connected(kNow);
  p.receive(asked, kNow);
  p.advance(kNow);
  const auto answer = modbus::decode_answer(p.take_output(), modbus::Transport::Rtu,
                                            {.unit = 1, .address = 49, .count = 1});
  ASSERT_TRUE(answer && *answer);
  EXPECT_EQ((*answer)->exception, 1);
}

TEST(RecordedDialogue, ASerialLineIsOneConnection) {
  const auto asked = request(modbus::Transport::Rtu);
  auto p = player(Script{RecordedKind::ModbusRtu}
                      .connect()
                      .ask(asked)
                      .say(bytes("first"))
                      .connect()
                      .ask(asked)
                      .say(bytes("second")));
  p.connected(kNow);
  p.receive(asked, kNow);

  EXPECT_EQ(said(p, kNow), "first");
  p.receive(asked, kNow);
  EXPECT_EQ(said(p, kNow), "second");
}

TEST(RecordedKinds, AreKnownByWhatWasSaid) {
  const auto kind = [](Script s) { return kind_of(s.device.blocks); };
  Script s{RecordedKind::Tracker};
  EXPECT_EQ(kind(Script{s}.connect().ask(request(modbus::Transport::Tcp))),
            RecordedKind::ModbusTcp);
  EXPECT_EQ(kind(Script{s}.connect().ask(request(modbus::Transport::Rtu))),
            RecordedKind::ModbusRtu);
  EXPECT_EQ(kind(Script{s}.say(bytes("rubbish")).ask(bytes("00001 StartSession()\r\n"))),
            RecordedKind::MeasuringMachine);
  EXPECT_EQ(kind(Script{s}.ask(bytes({"\x0c\0\0\0\0\0\0\0\1\0\0\0", 12}))), RecordedKind::Tracker);
}

}  // namespace
}  // namespace abbe::sim
