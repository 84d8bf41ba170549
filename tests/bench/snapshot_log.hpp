#pragma once
/// A subscriber that records when each Snapshot arrived, with the same kind of reader as the plain
/// Fast DDS hop (dds_hop.hpp): the time is read in the listener after the sample was taken from the
/// reader. Compensation states when abbed's hub received the axis positions (age_ns counts from
/// host_time_ns to that instant), so that the measurement needs no clock in abbed.

#include <fastdds/dds/domain/DomainParticipant.hpp>
#include <fastdds/dds/subscriber/DataReader.hpp>
#include <fastdds/dds/subscriber/DataReaderListener.hpp>
#include <fastdds/dds/subscriber/SampleInfo.hpp>
#include <fastdds/dds/subscriber/Subscriber.hpp>

#include <array>
#include <atomic>
#include <chrono>
#include <cstddef>
#include <cstdint>
#include <cstring>
#include <string_view>
#include <thread>

#include "abbe/dds/participant.hpp"
#include "abbe/dds/payload_type.hpp"
#include "abbe/dds/qos.hpp"
#include "abbe/messages/cdr.hpp"

namespace abbe::bench {

[[nodiscard]] inline std::int64_t monotonic_ns() {
  return std::chrono::steady_clock::now().time_since_epoch().count();
}

/// A log with one writer and one reader, in memory shared by two processes. When the log is full,
/// further arrivals are not recorded.
template <class T, std::size_t Capacity>
class SharedLog {
 public:
  void add(const T& entry) {
    const std::size_t n = size_.load(std::memory_order_relaxed);
    if (n == Capacity) return;
    entries_[n] = entry;
    size_.store(n + 1, std::memory_order_release);  // release: pairs with the acquire in size()
  }
  [[nodiscard]] std::size_t size() const { return size_.load(std::memory_order_acquire); }
  [[nodiscard]] const T& operator[](std::size_t i) const { return entries_[i]; }

 private:
  std::atomic<std::size_t> size_{0};
  std::array<T, Capacity> entries_;
};

/// Times are CLOCK_MONOTONIC, which is the host time of abbe if the simulation runs at speed 1.
struct Arrival {
  std::int64_t host_time_ns = 0;            ///< time of the SYNC
  std::int64_t tracker_device_time_ns = 0;  ///< time of the newest point; 0: no point yet
  std::int64_t arrived_ns = 0;
};

/// A cycle of the hub that published.
struct HubCycle {
  std::int64_t host_time_ns = 0;
  std::int64_t hub_ns = 0;
};

/// Time in receive() of a device: from the return of wait() to its samples in the ring.
struct DeviceLatency {
  double p50_s = 0.0;
  double p99_s = 0.0;
};

struct SnapshotLog {
  SharedLog<Arrival, 400'000> arrivals;
  SharedLog<HubCycle, 400'000> turns;
  DeviceLatency encoder, tracker;  ///< the latest; read it after the subscriber has ended
  std::atomic<bool> failed{false};
  std::atomic<bool> stop{false};
};

/// Calls `on_payload(payload, arrived_ns)` on Fast DDS's thread.
template <class OnPayload>
class PayloadListener final : public eprosima::fastdds::dds::DataReaderListener {
 public:
  explicit PayloadListener(OnPayload on_payload) : on_payload_(std::move(on_payload)) {}
  void on_data_available(eprosima::fastdds::dds::DataReader* reader) override {
    eprosima::fastdds::dds::SampleInfo info;
    while (reader->take_next_sample(&payload_, &info) ==
           eprosima::fastrtps::types::ReturnCode_t::RETCODE_OK) {
      const std::int64_t arrived_ns = monotonic_ns();
      if (info.valid_data) on_payload_(payload_.bytes, arrived_ns);
    }
  }

 private:
  OnPayload on_payload_;
  dds::Payload payload_;
};

inline void note_snapshot(SnapshotLog& log, std::span<const std::byte> payload,
                          std::int64_t arrived_ns) {
  const auto snapshot = daemon::decode<v1::Snapshot>(payload);
  if (!snapshot) return;
  log.arrivals.add({snapshot->host_time_ns(),
                    snapshot->has_tracker_point() ? snapshot->tracker_device_time_ns() : 0,
                    arrived_ns});
}

inline void note_turn(SnapshotLog& log, std::span<const std::byte> payload) {
  const auto compensation = daemon::decode<v1::Compensation>(payload);
  if (!compensation) return;
  log.turns.add(
      {compensation->host_time_ns(), compensation->host_time_ns() + compensation->age_ns()});
}

inline void note_health(SnapshotLog& log, std::span<const std::byte> payload) {
  const auto health = daemon::decode<v1::Health>(payload);
  if (!health) return;
  const std::string_view stream = health->stream().c_str();
  if (stream == "encoder") log.encoder = {health->latency_p50_s(), health->latency_p99_s()};
  if (stream == "tracker") log.tracker = {health->latency_p50_s(), health->latency_p99_s()};
}

/// Runs until log.stop is set.
inline void subscribe(SnapshotLog& log, const dds::ParticipantOptions& options) {
  using daemon::Topic;
  PayloadListener on_snapshot(
      [&](const auto& bytes, std::int64_t at) { note_snapshot(log, bytes, at); });
  PayloadListener on_turn([&](const auto& bytes, std::int64_t) { note_turn(log, bytes); });
  PayloadListener on_health([&](const auto& bytes, std::int64_t) { note_health(log, bytes); });
  auto participant = dds::Participant::create(options);
  auto* subscriber =
      participant
          ? participant->get().create_subscriber(eprosima::fastdds::dds::SUBSCRIBER_QOS_DEFAULT)
          : nullptr;

  const auto listen = [&](Topic topic, eprosima::fastdds::dds::DataReaderListener& listener) {
    const auto created = participant->topic(topic);
    return created &&
           subscriber->create_datareader(*created, dds::reader_qos(topic), &listener) != nullptr;
  };

  log.failed = subscriber == nullptr || !listen(Topic::Snapshot, on_snapshot) ||
               !listen(Topic::Compensation, on_turn) || !listen(Topic::Health, on_health);
  while (!log.failed && !log.stop) std::this_thread::sleep_for(std::chrono::milliseconds{5});
}

}  // namespace abbe::bench
