#include "abbe/sim/recorded_tracker.hpp"

#include <algorithm>
#include <array>
#include <utility>

#include "abbe/protocol/bytes.hpp"
#include "abbe/protocol/emscon/answers.hpp"

namespace abbe::sim {
namespace {

namespace emscon = protocol::emscon;

struct Head {
  std::int32_t type = 0;
  std::int32_t command = 0;
};

Head head_of(std::span<const std::byte> packet) {
  protocol::ByteReader reader(packet);
  reader.skip(sizeof(std::int32_t));
  Head head;
  head.type = reader.little<std::int32_t>();
  head.command = reader.little<std::int32_t>();
  return head;
}

constexpr auto kCommandType = static_cast<std::int32_t>(emscon::PacketType::Command);
constexpr auto kStart = static_cast<std::int32_t>(emscon::Command::StartMeasurement);
constexpr auto kStop = static_cast<std::int32_t>(emscon::Command::StopMeasurement);
constexpr auto kReflectors = static_cast<std::int32_t>(emscon::Command::GetReflectors);

bool accepted(std::span<const std::byte> packet) {
  const auto answer = emscon::decode_answer(packet);
  return answer && emscon::accepted(status_of(*answer));
}

}  // namespace

RecordedTracker::RecordedTracker(const RecordedDevice& device, ReplayTimeline& timeline)
    : timeline_(timeline) {
  for (const RecordedBlock& block : device.blocks) {
    if (block.connects() || connections_.empty()) {
      framer_.reset();
      connections_.emplace_back().began = block.time;
    }
    read(block);
  }
  if (connections_.empty()) connections_.emplace_back();
  framer_.reset();
}

void RecordedTracker::read(const RecordedBlock& block) {
  Connection& connection = connections_.back();
  if (block.lost()) {
    connection.unsolicited.push_back({block.time, {}, true});
    return;
  }

  if (block.to_device) {
    connection.exchanges[head_of(block.bytes).command].push_back({.asked = block.time});
    return;
  }

  if (block.hole_before) framer_.resync();
  if (connection.garbled) {
    connection.unsolicited.push_back({block.time, block.bytes});
    return;
  }

  for (auto rest = std::span<const std::byte>(block.bytes); !rest.empty() && !framer_.broken();) {
    rest = rest.subspan(framer_.push(rest));
    while (const auto packet = framer_.next()) take(*packet, block.time);
  }

  if (!framer_.broken()) return;
  const auto refused = framer_.refused();
  connection.unsolicited.push_back({block.time, {refused.begin(), refused.end()}});
  connection.garbled = true;
}

void RecordedTracker::take(std::span<const std::byte> packet, HostTime time) {
  const Head head = head_of(packet);
  if (head.type == kCommandType) return take_answer(head.command, packet, time);
  connections_.back().unsolicited.push_back({time, {packet.begin(), packet.end()}});
}

void RecordedTracker::take_answer(std::int32_t command, std::span<const std::byte> packet,
                                  HostTime time) {
  Connection& connection = connections_.back();
  auto& exchanges = connection.exchanges[command];
  auto exchange = std::ranges::find_if(
      exchanges, [](const Exchange& e) { return e.answers.size() < e.wanted; });

  // A recording that began during a session may contain an answer, but not its command.
  if (exchange == exchanges.end()) exchange = exchanges.insert(exchange, {.asked = time});
  if (command == kReflectors) {  // this command has several answers, one per reflector
    const auto first = emscon::decode_answer(packet);
    const auto* reflectors = first ? std::get_if<emscon::ReflectorsAnswer>(&*first) : nullptr;
    if (reflectors != nullptr)
      exchange->wanted = static_cast<std::size_t>(std::max(reflectors->total, 1));
  }

  exchange->answered = time;
  exchange->answers.emplace_back(packet.begin(), packet.end());
  if (command == kStart && !connection.first_start && accepted(packet))
    connection.first_start = time;
}

std::size_t RecordedTracker::packets() const {
  std::size_t sum = 0;
  for (const Connection& connection : connections_) sum += connection.unsolicited.size();
  return sum;
}

void RecordedTracker::connected(HostTime now) {
  if (std::exchange(played_, true)) connection_ = (connection_ + 1) % connections_.size();
  connected_at_ = now;
}

void RecordedTracker::disconnected() {
  framer_.reset();
  connected_at_.reset();
  out_.clear();
  answered_.clear();
  due_.clear();
  next_ = 0;
  anchored_ = stopped_ = wants_close_ = false;
  if (connection_ + 1 == connections_.size()) timeline_.rewind();
}

void RecordedTracker::receive(std::span<const std::byte> bytes, HostTime now) {
  while (!bytes.empty() && !framer_.broken()) {
    bytes = bytes.subspan(framer_.push(bytes));
    while (const auto packet = framer_.next()) answer(*packet, now);
  }
  wants_close_ = wants_close_ || framer_.broken();
  advance(now);
}

void RecordedTracker::answer(std::span<const std::byte> request, HostTime now) {
  const std::int32_t command = head_of(request).command;
  const auto known = connection().exchanges.find(command);
  if (known == connection().exchanges.end()) {
    std::array<std::byte, emscon::kMaxAnswerSize> refusal{};
    const emscon::Acknowledge no{static_cast<emscon::Command>(command),
                                 emscon::Status::NotImplemented};
    return send_packet(std::span(refusal).first(emscon::encode(emscon::Answer{no}, refusal)));
  }

  const std::size_t repetition = answered_[command]++;
  const Exchange& exchange = known->second[std::min(repetition, known->second.size() - 1)];
  if (exchange.answers.empty()) return;
  Due due{now + (exchange.answered - exchange.asked), exchange.answers};
  if (command == kStart && accepted(exchange.answers.front())) due.starts = exchange.answered;
  due.stops = command == kStop;
  due_.push_back(std::move(due));
}

void RecordedTracker::carry_out(const Due& due) {
  for (const Packet& packet : due.packets) send_packet(packet);
  if (due.stops) stopped_ = true;
  if (!due.starts) return;
  anchored_ = true;
  stopped_ = false;
  timeline_.restart(*due.starts, due.time);
}

HostTime RecordedTracker::unsolicited_due() const {
  if (!connected_at_ || next_ >= connection().unsolicited.size() || stopped_)
    return HostTime::max();
  const HostTime time = connection().unsolicited[next_].time;
  if (anchored_) return timeline_.due(time);
  const bool waits = connection().first_start && time >= *connection().first_start;
  return waits ? HostTime::max() : *connected_at_ + (time - connection().began);
}

HostTime RecordedTracker::next_due() const {
  return due_.empty() ? unsolicited_due() : std::min(due_.front().time, unsolicited_due());
}

void RecordedTracker::advance(HostTime now) {
  while (next_due() <= now) {
    if (!due_.empty() && due_.front().time <= unsolicited_due()) {
      carry_out(due_.front());
      due_.pop_front();
    } else {
      const Unsolicited& unsolicited = connection().unsolicited[next_++];
      send_packet(unsolicited.packet);
      wants_close_ = wants_close_ || unsolicited.breaks;
    }
  }

  const bool last = connection_ + 1 == connections_.size();
  const bool begun = anchored_ || (played_ && !connection().first_start);
  finished_ = finished_ || (last && begun && next_ >= connection().unsolicited.size());
}

std::vector<std::byte> RecordedTracker::take_output() {
  return std::exchange(out_, {});
}

}  // namespace abbe::sim
