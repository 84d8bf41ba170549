/// Replay of Modbus and I++ DME recordings: the recorded answers are sent again.

#include <gtest/gtest.h>

#include <string>

#include "abbe/protocol/modbus/read.hpp"
#include "abbe/sim/recorded_dialogue.hpp"
#include "recording_instants.hpp"

namespace abbe::sim {
namespace {

using namespace std::chrono_literals;
namespace modbus = protocol::modbus;

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
  Script& answer(std::vector<std::byte> b) { return add(false, std::move(b)); }
  Script& after(std::chrono::nanoseconds d) {
    time += d;
    return *this;
  }
  RecordedDevice device;
  HostTime time = kRecorded;

 private:
  Script& add(bool to_device, std::vector<std::byte> b) {
    device.blocks.push_back({time, to_device, false, std::move(b)});
    return *this;
  }
};

RecordedDialogue player(const Script& script) {
  return RecordedDialogue{script.device, dialogue_wire(script.device.kind)};
}

std::string output_of(RecordedDialogue& player, HostTime now) {
  player.advance(now);
  return text(player.take_output());
}
std::string reply(RecordedDialogue& player, std::string_view line, HostTime now = kReplayed) {
  player.receive(bytes(line), now);
  return output_of(player, now);
}

Script two_requests() {
  Script s{RecordedKind::MeasuringMachine};
  s.connect()
      .ask(bytes("00001 Get(X())\r\n"))
      .answer(bytes("00001 &\r\n00001 # X(1)\r\n00001 %\r\n"));
  s.ask(bytes("00002 Get(X())\r\n"))
      .answer(bytes("00002 &\r\n000"))
      .after(10ms)
      .answer(bytes("02 # X(2)\r\n00002 %\r\n"));
  return s;
}

TEST(RecordedDialogue, AnswersTheNthEqualRequestAsRecordedThenRepeatsTheLastAnswer) {
  auto p = player(two_requests());
  p.connected(kReplayed);
  EXPECT_EQ(reply(p, "00001 Get(X())\r\n"), "00001 &\r\n00001 # X(1)\r\n00001 %\r\n");
  p.receive(bytes("00002 Get(X())\r\n"), kReplayed);
  EXPECT_EQ(output_of(p, kReplayed + 10ms), "00002 &\r\n00002 # X(2)\r\n00002 %\r\n");
  EXPECT_TRUE(p.finished());
  p.receive(bytes("00003 Get(X())\r\n"), kReplayed);
  EXPECT_EQ(output_of(p, kReplayed + 10ms), "00003 &\r\n00003 # X(2)\r\n00003 %\r\n");
}

TEST(RecordedDialogue, RenumbersASplitAnswerAndKeepsItsPieces) {
  auto p = player(two_requests());
  p.connected(kReplayed);
  reply(p, "00007 Get(X())\r\n");
  EXPECT_EQ(reply(p, "00008 Get(X())\r\n"), "00008 &\r\n000");
  EXPECT_EQ(p.next_due(), kReplayed + 10ms);
  EXPECT_EQ(output_of(p, kReplayed + 10ms), "08 # X(2)\r\n00008 %\r\n");
}

TEST(RecordedDialogue, WaitsForACompleteRequest) {
  auto p = player(two_requests());
  p.connected(kReplayed);
  EXPECT_EQ(reply(p, "00001 Get("), "");
  EXPECT_EQ(reply(p, "X())\r\n"), "00001 &\r\n00001 # X(1)\r\n00001 %\r\n");
}

TEST(RecordedDialogue, RefusesARequestThatIsNotInTheRecording) {
  auto p = player(two_requests());
  p.connected(kReplayed);
  EXPECT_EQ(
      reply(p, "00001 Home()\r\n"),
      "00001 &\r\n00001 ! Error(2,0501,\"replay\",\"Not asked in the recording\")\r\n00001 %\r\n");
}

TEST(RecordedDialogue, BreaksAsRecordedAndContinuesWithTheNextConnection) {
  Script s{RecordedKind::MeasuringMachine};
  s.connect().ask(bytes("00001 Get(X())\r\n")).after(20ms).lose();
  s.after(1s).connect().ask(bytes("00001 Get(X())\r\n")).answer(bytes("00001 # X(3)\r\n"));
  auto p = player(s);
  p.connected(kReplayed);

  EXPECT_EQ(reply(p, "00001 Get(X())\r\n"), "");
  EXPECT_FALSE(p.wants_close());
  p.advance(kReplayed + 20ms);
  EXPECT_TRUE(p.wants_close());
  p.disconnected();
  p.connected(kReplayed + 1s);
  EXPECT_EQ(reply(p, "00001 Get(X())\r\n", kReplayed + 1s), "00001 # X(3)\r\n");
  p.disconnected();
  p.connected(kReplayed + 2s);  // after the last connection the replay begins again
  EXPECT_EQ(reply(p, "00001 Get(X())\r\n", kReplayed + 2s), "");
}

TEST(RecordedDialogue, IsSilentAsRecordedButNotAtTheEndOfTheRecording) {
  Script s{RecordedKind::MeasuringMachine};
  s.connect()
      .ask(bytes("00001 Get(X())\r\n"))
      .ask(bytes("00002 Get(X())\r\n"))
      .answer(bytes("00002 # X(3)\r\n"));
  s.ask(bytes("00003 Get(X())\r\n"));
  auto p = player(s);
  p.connected(kReplayed);
  EXPECT_EQ(reply(p, "00001 Get(X())\r\n"), "");
  EXPECT_EQ(reply(p, "00002 Get(X())\r\n"), "00002 # X(3)\r\n");
  EXPECT_EQ(reply(p, "00003 Get(X())\r\n"), "00003 # X(3)\r\n");
}

std::vector<std::byte> request(modbus::Transport transport) {
  std::vector<std::byte> frame(modbus::kMaxAduSize);
  frame.resize(modbus::encode({.unit = 1, .address = 49, .count = 1}, transport, frame));
  return frame;
}

TEST(RecordedDialogue, GivesAModbusAnswerTheNumberOfItsRequest) {
  const auto asked = request(modbus::Transport::Tcp);
  const std::vector<std::byte> recorded_answer = bytes({"\0\0\0\0\0\5\1\3\2\0\7", 11});
  auto p = player(Script{RecordedKind::ModbusTcp}.connect().ask(asked).answer(recorded_answer));
  p.connected(kReplayed);
  auto again = asked;
  again[0] = std::byte{0x12};
  again[1] = std::byte{0x34};
  p.receive(again, kReplayed);
  p.advance(kReplayed);
  auto wanted = recorded_answer;
  wanted[0] = std::byte{0x12};
  wanted[1] = std::byte{0x34};

  EXPECT_EQ(p.take_output(), wanted);
}

TEST(RecordedDialogue, AnswersAnUnknownReadWithAModbusException) {
  const auto asked = request(modbus::Transport::Rtu);
  auto p = player(Script{RecordedKind::ModbusRtu}.connect());
  p.connected(kReplayed);
  p.receive(asked, kReplayed);
  p.advance(kReplayed);
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
                      .answer(bytes("first"))
                      .connect()
                      .ask(asked)
                      .answer(bytes("second")));
  p.connected(kReplayed);
  p.receive(asked, kReplayed);

  EXPECT_EQ(output_of(p, kReplayed), "first");
  p.receive(asked, kReplayed);
  EXPECT_EQ(output_of(p, kReplayed), "second");
}

TEST(RecordedKinds, AreDetectedFromTheRecordedBytes) {
  const auto kind = [](Script s) { return kind_of(s.device.blocks); };
  Script s{RecordedKind::Tracker};
  EXPECT_EQ(kind(Script{s}.connect().ask(request(modbus::Transport::Tcp))),
            RecordedKind::ModbusTcp);
  EXPECT_EQ(kind(Script{s}.connect().ask(request(modbus::Transport::Rtu))),
            RecordedKind::ModbusRtu);
  EXPECT_EQ(kind(Script{s}.answer(bytes("rubbish")).ask(bytes("00001 StartSession()\r\n"))),
            RecordedKind::MeasuringMachine);
  EXPECT_EQ(kind(Script{s}.ask(bytes({"\x0c\0\0\0\0\0\0\0\1\0\0\0", 12}))), RecordedKind::Tracker);
}

}  // namespace
}  // namespace abbe::sim
