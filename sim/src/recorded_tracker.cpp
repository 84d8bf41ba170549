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
    if (block.to_device) continue;
    for (auto rest = std::span<const std::byte>(block.bytes); !rest.empty();) {
      rest = rest.subspan(framer_.push(rest));
      while (const auto packet = framer_.next()) take(*packet, block.time);
      if (framer_.broken()) framer_.resync();  // lost blocks, or a connection that broke inside a packet
    }
  }
  framer_.reset();
}

void RecordedTracker::take(std::span<const std::byte> packet, HostTime time) {
  const Head head = head_of(packet);
  if (head.type != kCommandType) {
    if (started_) spoken_.push_back({time, {packet.begin(), packet.end()}});
    return;
  }
  if (head.command == kStart && !started_ && accepted(packet)) started_ = time;
  answers_[head.command].packets.emplace_back(packet.begin(), packet.end());
}

void RecordedTracker::connected(HostTime) {
  disconnected();
}

void RecordedTracker::disconnected() {
  framer_.reset();
  out_.clear();
  for (auto& [command, answers] : answers_) answers.next = 0;
  playing_ = false;
  wants_close_ = false;
  next_ = 0;
  timeline_.rewind();
}

void RecordedTracker::receive(std::span<const std::byte> bytes, HostTime now) {
  while (!bytes.empty() && !framer_.broken()) {
    bytes = bytes.subspan(framer_.push(bytes));
    while (const auto packet = framer_.next()) answer(*packet, now);
  }
  wants_close_ = wants_close_ || framer_.broken();
}

void RecordedTracker::answer(std::span<const std::byte> request, HostTime now) {
  const std::int32_t command = head_of(request).command;
  const auto known = answers_.find(command);
  if (known == answers_.end()) {
    std::array<std::byte, emscon::kMaxAnswerSize> refusal{};
    const emscon::Acknowledge no{static_cast<emscon::Command>(command), emscon::Status::NotImplemented};
    return say(std::span(refusal).first(emscon::encode(emscon::Answer{no}, refusal)));
  }
  Answers& answers = known->second;
  std::size_t count = 1;
  if (command == kReflectors) {  // the one command with an answer per reflector
    const auto first = emscon::decode_answer(answers.packets[answers.next]);
    const auto* reflectors = first ? std::get_if<emscon::ReflectorsAnswer>(&*first) : nullptr;
    if (reflectors != nullptr) count = static_cast<std::size_t>(std::max(reflectors->total, 1));
  }
  const std::size_t from = answers.next;
  for (std::size_t i = from; i < std::min(from + count, answers.packets.size()); ++i) say(answers.packets[i]);
  if (from + count < answers.packets.size()) answers.next = from + count;
  if (command == kStop) playing_ = false;
  if (command == kStart && started_ && accepted(answers.packets[from])) {
    playing_ = true;
    timeline_.start(*started_, now);
  }
}

HostTime RecordedTracker::next_due() const {
  return playing_ && next_ < spoken_.size() ? timeline_.due(spoken_[next_].time) : HostTime::max();
}

void RecordedTracker::advance(HostTime now) {
  for (; next_due() <= now; ++next_) say(spoken_[next_].packet);
}

std::vector<std::byte> RecordedTracker::take_output() {
  return std::exchange(out_, {});
}

}  // namespace abbe::sim
