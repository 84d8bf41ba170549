// Any bytes as a payload of any type: refused with a reason, or a value that encodes and decodes to
// itself. A key is found in every encoded value. The first byte chooses the type.

#include <cstddef>
#include <cstdint>
#include <cstdlib>
#include <span>
#include <vector>

#include "abbe/messages/cdr.hpp"
#include "abbe/messages/topics.hpp"

namespace {

using namespace abbe;

void require(bool holds) {
  if (!holds) std::abort();
}

/// What it encodes to; nothing if it was refused.
template <class T>
std::vector<std::byte> round_trip(std::span<const std::byte> payload) {
  const auto value = daemon::decode<T>(payload);
  if (!value) {
    require(!value.error().text.empty());
    return {};
  }
  std::vector<std::byte> again, and_again;
  require(daemon::encode(*value, again).has_value());
  const auto same = daemon::decode<T>(again);
  // Bytes rather than values are compared: NaN is not equal to itself.
  require(same.has_value() && daemon::encode(*same, and_again).has_value() && again == and_again);
  return again;
}

/// A type that is published: what we encode has a key. Foreign bytes may decode without a key (text
/// that continues after its NUL); they are then discarded.
template <class T>
void published(daemon::Topic topic, std::span<const std::byte> payload) {
  (void)daemon::payload_key(topic, payload);
  const auto encoded = round_trip<T>(payload);
  require(encoded.empty() || daemon::payload_key(topic, encoded).has_value());
}

}  // namespace

extern "C" int LLVMFuzzerTestOneInput(const std::uint8_t* data, std::size_t size) {
  if (size == 0) return 0;
  const auto payload = std::as_bytes(std::span(data, size)).subspan(1);
  switch (data[0] % 14) {
    case 0:
      published<v1::Snapshot>(daemon::Topic::Snapshot, payload);
      break;
    case 1:
      published<v1::Compensation>(daemon::Topic::Compensation, payload);
      break;
    case 2:
      published<v1::ErrorModel>(daemon::Topic::ErrorModel, payload);
      break;
    case 3:
      published<v1::ErrorGrid>(daemon::Topic::ErrorGrid, payload);
      break;
    case 4:
      published<v1::ModelState>(daemon::Topic::ModelState, payload);
      break;
    case 5:
      published<v1::Health>(daemon::Topic::Health, payload);
      break;
    case 6:
      published<v1::CalibrationEvent>(daemon::Topic::CalibrationEvent, payload);
      break;
    case 7:
      round_trip<v1::TrackerPoint>(payload);
      break;
    case 8:
      round_trip<v1::AxisSample>(payload);
      break;
    case 9:
      round_trip<v1::EnvironmentSample>(payload);
      break;
    case 11:
      round_trip<v1::ProbeTrigger>(payload);
      break;
    case 12:
      round_trip<v1::TouchScan>(payload);
      break;
    case 13:
      published<v1::Identity>(daemon::Topic::Identity, payload);
      break;
    default:
      round_trip<v1::RawBytes>(payload);
      break;
  }

  return 0;
}
