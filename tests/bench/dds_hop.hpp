#pragma once
/// One hop through plain Fast DDS, used for comparison: a fixed number of bytes from one process to
/// another, without key or CDR, best effort, keep last 1, UDP on loopback with the transport
/// profile of abbe. The one-way delay is measured with CLOCK_MONOTONIC, which is common to both
/// processes. measure_dds_hop() forks: call it before the process has threads or a DDS participant.

#include <sys/mman.h>
#include <sys/wait.h>
#include <unistd.h>
#include <fastdds/dds/domain/DomainParticipant.hpp>
#include <fastdds/dds/publisher/DataWriter.hpp>
#include <fastdds/dds/publisher/Publisher.hpp>
#include <fastdds/dds/subscriber/DataReader.hpp>
#include <fastdds/dds/subscriber/DataReaderListener.hpp>
#include <fastdds/dds/subscriber/SampleInfo.hpp>
#include <fastdds/dds/subscriber/Subscriber.hpp>
#include <fastdds/dds/topic/TopicDataType.hpp>
#include <fastdds/dds/topic/TypeSupport.hpp>

#include <algorithm>
#include <array>
#include <atomic>
#include <chrono>
#include <cstdint>
#include <cstring>
#include <filesystem>
#include <new>
#include <thread>
#include <vector>

#include "abbe/dds/participant.hpp"
#include "abbe/dds/qos.hpp"

namespace abbe::bench {

struct HopOptions {
  std::size_t samples = 3000;
  std::size_t warm_up = 200;  ///< sent first, not counted
  std::chrono::microseconds period{1000};
  std::chrono::nanoseconds
      phase{};  ///< sends when CLOCK_MONOTONIC is a multiple of the period plus this
  std::uint32_t domain = 96;
  std::filesystem::path profile;  ///< abbe-dds-loopback.xml
};

struct HopResult {
  std::size_t received = 0;
  double p50_us = 0.0;
  double p99_us = 0.0;
};

namespace hop {

namespace fast = eprosima::fastdds::dds;
using Clock = std::chrono::steady_clock;
inline constexpr std::size_t kMessageBytes = 200;
inline constexpr std::size_t kMostSamples = 100'000;

struct Message {
  std::int64_t number = 0;
  Clock::rep sent = 0;
  std::array<std::byte, kMessageBytes - 16> rest{};
};
static_assert(sizeof(Message) == kMessageBytes);

/// Memory shared by the two processes.
struct Shared {
  std::atomic<bool> failed{false};
  std::atomic<bool> stop{false};
  std::atomic<std::size_t> received{0};
  std::array<double, kMostSamples> latency_us;
};

class MessageType final : public fast::TopicDataType {
 public:
  MessageType() {
    setName("abbe::bench::Message");
    m_typeSize = 4 + kMessageBytes;
    auto_fill_type_information(false);
    auto_fill_type_object(false);
  }
  bool serialize(void* data, eprosima::fastrtps::rtps::SerializedPayload_t* payload) override {
    constexpr std::array<unsigned char, 4> kHeader{0, 1, 0, 0};
    std::memcpy(payload->data, kHeader.data(), kHeader.size());
    std::memcpy(payload->data + 4, data, kMessageBytes);
    payload->length = m_typeSize;
    return true;
  }
  bool deserialize(eprosima::fastrtps::rtps::SerializedPayload_t* payload, void* data) override {
    if (payload->length < m_typeSize) return false;
    std::memcpy(data, payload->data + 4, kMessageBytes);
    return true;
  }
  std::function<uint32_t()> getSerializedSizeProvider(void*) override {
    return [] { return static_cast<uint32_t>(4 + kMessageBytes); };
  }
  bool getKey(void*, eprosima::fastrtps::rtps::InstanceHandle_t*, bool) override { return false; }
  void* createData() override { return new Message; }
  void deleteData(void* data) override { delete static_cast<Message*>(data); }
  bool is_bounded() const override { return true; }
};

inline fast::Topic* topic_in(dds::Participant& participant) {
  fast::TypeSupport type(new MessageType);
  type.register_type(&participant.get());
  return participant.get().create_topic("abbe/bench/hop", type.get_type_name(),
                                        fast::TOPIC_QOS_DEFAULT);
}

class Receiver final : public fast::DataReaderListener {
 public:
  Receiver(Shared& shared, std::int64_t first) : shared_(shared), first_(first) {}

  void on_data_available(fast::DataReader* reader) override {
    fast::SampleInfo info;
    while (reader->take_next_sample(&message_, &info) ==
           eprosima::fastrtps::types::ReturnCode_t::RETCODE_OK) {
      const Clock::duration took = Clock::now().time_since_epoch() - Clock::duration(message_.sent);
      if (!info.valid_data || message_.number < first_) continue;
      const std::size_t n = shared_.received.load(std::memory_order_relaxed);
      if (n == kMostSamples) continue;
      shared_.latency_us[n] = std::chrono::duration<double, std::micro>(took).count();
      // release: pairs with the acquire in result_of()
      shared_.received.store(n + 1, std::memory_order_release);
    }
  }

 private:
  Shared& shared_;
  std::int64_t first_;
  Message message_;
};

inline void receive(Shared& shared, const HopOptions& options) {
  Receiver receiver(shared, static_cast<std::int64_t>(options.warm_up));
  auto participant = dds::Participant::create({options.domain, options.profile});
  auto* topic = participant ? topic_in(*participant) : nullptr;
  auto* subscriber = topic != nullptr
                         ? participant->get().create_subscriber(fast::SUBSCRIBER_QOS_DEFAULT)
                         : nullptr;

  if (subscriber == nullptr ||
      subscriber->create_datareader(topic, dds::reader_qos(daemon::Topic::Snapshot), &receiver) ==
          nullptr) {
    shared.failed = true;
    return;
  }

  while (!shared.stop) std::this_thread::sleep_for(std::chrono::milliseconds{5});
}

inline bool wait_for_reader(fast::DataWriter& writer, const Shared& shared) {
  const auto deadline = Clock::now() + std::chrono::seconds{20};
  fast::PublicationMatchedStatus status;
  do {
    std::this_thread::sleep_for(std::chrono::milliseconds{20});
    writer.get_publication_matched_status(status);
  } while (status.current_count == 0 && !shared.failed && Clock::now() < deadline);
  return status.current_count > 0;
}

inline bool send(const Shared& shared, const HopOptions& options) {
  auto participant = dds::Participant::create({options.domain, options.profile});
  auto* topic = participant ? topic_in(*participant) : nullptr;
  auto* publisher =
      topic != nullptr ? participant->get().create_publisher(fast::PUBLISHER_QOS_DEFAULT) : nullptr;
  auto* writer = publisher != nullptr
                     ? publisher->create_datawriter(topic, dds::writer_qos(daemon::Topic::Snapshot))
                     : nullptr;
  if (writer == nullptr || !wait_for_reader(*writer, shared)) return false;
  Message message;
  const std::chrono::nanoseconds period = options.period;
  auto next = Clock::now();
  next += period - (next.time_since_epoch() - options.phase) % period;

  for (std::size_t i = 0; i < options.warm_up + options.samples; ++i) {
    std::this_thread::sleep_until(next += options.period);
    message.number = static_cast<std::int64_t>(i);
    message.sent = Clock::now().time_since_epoch().count();
    writer->write(&message);
  }

  std::this_thread::sleep_for(std::chrono::milliseconds{100});  // packets in transit arrive
  return true;
}

inline HopResult result_of(const Shared& shared) {
  // acquire: pairs with the release in Receiver
  const std::size_t n = shared.received.load(std::memory_order_acquire);
  std::vector<double> sorted(shared.latency_us.begin(),
                             shared.latency_us.begin() + static_cast<std::ptrdiff_t>(n));
  std::sort(sorted.begin(), sorted.end());
  if (n == 0) return {};
  return {n, sorted[n / 2], sorted[std::min(n - 1, n * 99 / 100)]};
}

}  // namespace hop

/// Measures the delays. `received` of the result is 0 if a participant could not be created, or if
/// the two processes did not discover each other.
[[nodiscard]] inline HopResult measure_dds_hop(const HopOptions& options) {
  void* memory = ::mmap(nullptr, sizeof(hop::Shared), PROT_READ | PROT_WRITE,
                        MAP_SHARED | MAP_ANONYMOUS, -1, 0);
  if (memory == MAP_FAILED) return {};
  auto* shared = new (memory) hop::Shared;
  const pid_t receiver = ::fork();

  if (receiver == 0) {
    hop::receive(*shared, options);
    ::_exit(0);
  }

  const bool sent = receiver > 0 && hop::send(*shared, options);
  shared->stop = true;
  if (receiver > 0) ::waitpid(receiver, nullptr, 0);
  const HopResult result = sent ? hop::result_of(*shared) : HopResult{};
  ::munmap(memory, sizeof(hop::Shared));

  return result;
}

}  // namespace abbe::bench
