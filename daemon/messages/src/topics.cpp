#include "abbe/messages/topics.hpp"

#include <cstring>

namespace abbe::daemon {
namespace {

using namespace std::chrono_literals;
using Kind = TopicTraits::Kind;
using Key = TopicTraits::Key;

constexpr std::array<TopicTraits, kTopicCount> kTopics{{
    {Topic::Snapshot, "abbe/v1/Snapshot", "abbe::v1::Snapshot", Kind::Live, Key::Machine, 0ms},
    {Topic::Compensation, "abbe/v1/Compensation", "abbe::v1::Compensation", Kind::Live,
     Key::Machine, 0ms},
    {Topic::ErrorModel, "abbe/v1/ErrorModel", "abbe::v1::ErrorModel", Kind::Durable, Key::Machine,
     10s},
    {Topic::ErrorGrid, "abbe/v1/ErrorGrid", "abbe::v1::ErrorGrid", Kind::Durable,
     Key::MachineAndNumber, 10s},
    {Topic::ModelState, "abbe/v1/ModelState", "abbe::v1::ModelState", Kind::Durable, Key::Machine,
     1s},
    {Topic::Health, "abbe/v1/Health", "abbe::v1::Health", Kind::Durable, Key::MachineAndText, 10s},
    {Topic::CalibrationEvent, "abbe/v1/CalibrationEvent", "abbe::v1::CalibrationEvent",
     Kind::Durable, Key::Machine, 10s},
    {Topic::Identity, "abbe/v1/Identity", "abbe::v1::Identity", Kind::Durable, Key::Machine, 1s},
}};

/// Reads CDR_LE. `body` begins after the encapsulation header; alignment is relative to this point.
class KeyReader {
 public:
  explicit KeyReader(std::span<const std::byte> body) : body_(body) {}

  std::optional<std::uint32_t> number() {
    const std::size_t at = (offset_ + 3) / 4 * 4;
    if (at + 4 > body_.size()) return std::nullopt;
    std::uint32_t value = 0;
    for (std::size_t i = 0; i < 4; ++i)
      value |= std::to_integer<std::uint32_t>(body_[at + i]) << (8 * i);
    offset_ = at + 4;
    return value;
  }

  std::optional<std::string_view> text() {
    const auto length = number();  // includes the NUL
    if (!length || *length == 0 || *length > body_.size() - offset_) return std::nullopt;
    const auto* begin = reinterpret_cast<const char*>(body_.data() + offset_);
    if (std::memchr(begin, 0, *length) != begin + *length - 1) return std::nullopt;
    offset_ += *length;
    return std::string_view(begin, *length - 1);
  }

  /// Skips `bytes` bytes that begin at the next multiple of `alignment`.
  bool skip(std::size_t alignment, std::size_t bytes) {
    const std::size_t at = (offset_ + alignment - 1) / alignment * alignment;
    if (at > body_.size() || bytes > body_.size() - at) return false;
    offset_ = at + bytes;
    return true;
  }

  [[nodiscard]] std::span<const std::byte> read_so_far() const { return body_.first(offset_); }

 private:
  std::span<const std::byte> body_;
  std::size_t offset_ = 0;
};

}  // namespace

const TopicTraits& traits(Topic topic) noexcept {
  return kTopics[static_cast<std::size_t>(topic)];
}

std::span<const TopicTraits> all_topics() noexcept {
  return kTopics;
}

std::optional<Topic> topic_from(std::uint8_t value) noexcept {
  if (value >= kTopicCount) return std::nullopt;
  return static_cast<Topic>(value);
}

std::optional<PayloadKey> payload_key(Topic topic, std::span<const std::byte> payload) noexcept {
  if (payload.size() < kCdrHeaderBytes || payload[0] != std::byte{0} || payload[1] != std::byte{1})
    return std::nullopt;
  KeyReader reader(payload.subspan(kCdrHeaderBytes));
  PayloadKey key;
  const auto machine = reader.text();
  if (!machine) return std::nullopt;
  key.machine = *machine;
  if (traits(topic).key == Key::MachineAndNumber && !(key.number = reader.number()))
    return std::nullopt;
  if (traits(topic).key == Key::MachineAndText && !(key.text = reader.text())) return std::nullopt;
  key.bytes = reader.read_so_far();
  return key;
}

std::optional<std::uint32_t> grid_slices(std::span<const std::byte> payload) noexcept {
  if (!payload_key(Topic::ErrorGrid, payload)) return std::nullopt;
  KeyReader reader(payload.subspan(kCdrHeaderBytes));
  static_cast<void>(reader.text());    // machine
  static_cast<void>(reader.number());  // slice
  return reader.number();
}

bool set_sequence_number(Topic topic, std::span<std::byte> payload, std::uint64_t number) noexcept {
  if ((topic != Topic::ErrorModel && topic != Topic::ErrorGrid) || !payload_key(topic, payload))
    return false;
  const auto body = payload.subspan(kCdrHeaderBytes);
  KeyReader reader(body);
  if (!reader.text()) return false;                                       // machine
  if (topic == Topic::ErrorGrid && !reader.skip(4, 4 + 4)) return false;  // slice, slices
  if (!reader.skip(8, 8)) return false;
  const auto place = body.subspan(reader.read_so_far().size() - 8, 8);
  for (std::size_t i = 0; i < 8; ++i) place[i] = static_cast<std::byte>(number >> (8 * i) & 0xffu);
  return true;
}

bool add_to_age(std::span<std::byte> compensation, std::chrono::nanoseconds more) noexcept {
  if (!payload_key(Topic::Compensation, compensation)) return false;
  const auto body = compensation.subspan(kCdrHeaderBytes);
  KeyReader reader(body);
  constexpr std::size_t kDoubles = 3 + 3 + 3 + 6;  // position, tool offset, vector, covariance
  const bool whole = reader.text().has_value()     // machine
                     && reader.skip(8, 8 + 8)      // sequence_number, host_time_ns
                     && reader.skip(4, 4 + 4)      // kind, state
                     && reader.skip(1, 1 + 1)      // inside, tool_ok
                     && reader.skip(8, kDoubles * 8) && reader.text().has_value()  // model_id
                     && reader.skip(8, 8);                                         // age_ns
  const std::size_t end = reader.read_so_far().size();
  if (!whole || !reader.skip(8, 8) || reader.read_so_far().size() != body.size()) return false;

  const auto age = body.subspan(end - 8, 8);
  std::uint64_t ns = 0;
  for (std::size_t i = 0; i < 8; ++i) ns |= std::to_integer<std::uint64_t>(age[i]) << (8 * i);
  ns += static_cast<std::uint64_t>(more.count());
  for (std::size_t i = 0; i < 8; ++i) age[i] = static_cast<std::byte>(ns >> (8 * i) & 0xffu);

  return true;
}

}  // namespace abbe::daemon
