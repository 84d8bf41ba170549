// Counts the vectors of the feeder that arrive and those that are lost on the way, by their
// sequence numbers:
//   dds_vector_counter DOMAIN KEYS     prints "vectors SEEN LOST" five times a second until killed
// It takes each vector in the receiving thread, and its reader keeps 1000. With a reader that keeps
// only the last one, a vector could be overwritten by the next before it is counted.
#include <fastdds/dds/domain/DomainParticipant.hpp>
#include <fastdds/dds/subscriber/DataReader.hpp>
#include <fastdds/dds/subscriber/DataReaderListener.hpp>
#include <fastdds/dds/subscriber/SampleInfo.hpp>
#include <fastdds/dds/subscriber/Subscriber.hpp>

#include <cstdio>
#include <cstdlib>
#include <mutex>
#include <stdexcept>
#include <string>
#include <thread>
#include <utility>

#include "abbe/dds/participant.hpp"
#include "abbe/dds/payload_type.hpp"
#include "abbe/dds/qos.hpp"
#include "abbe/messages/cdr.hpp"

namespace abbe::test {
namespace {

struct VectorCount {
  long seen = 0, lost = 0;
};

class VectorCounter final : private eprosima::fastdds::dds::DataReaderListener {
 public:
  explicit VectorCounter(const dds::ParticipantOptions& options)
      : participant_(must(dds::Participant::create(options))) {
    namespace fast = eprosima::fastdds::dds;
    constexpr int kDepth = 1000;
    auto qos = dds::reader_qos(daemon::Topic::Compensation);
    qos.history().depth = kDepth;
    qos.resource_limits().max_instances = 1;
    qos.resource_limits().max_samples = kDepth;
    qos.resource_limits().max_samples_per_instance = kDepth;
    auto* topic = must(participant_.topic(daemon::Topic::Compensation));
    auto* subscriber = participant_.get().create_subscriber(fast::SUBSCRIBER_QOS_DEFAULT);
    reader_ = subscriber->create_datareader(topic, qos, this);
    if (reader_ == nullptr) throw std::runtime_error("vector counter: no reader");
  }
  ~VectorCounter() override { reader_->set_listener(nullptr); }
  VectorCounter(const VectorCounter&) = delete;
  VectorCounter& operator=(const VectorCounter&) = delete;

  [[nodiscard]] VectorCount count() const {
    const std::lock_guard lock(mutex_);
    return count_;
  }

 private:
  template <class T>
  static T must(daemon::Result<T> made) {
    if (!made) throw std::runtime_error("vector counter: " + made.error().text);
    return std::move(*made);
  }

  void on_data_available(eprosima::fastdds::dds::DataReader* reader) override {
    const std::lock_guard lock(mutex_);
    eprosima::fastdds::dds::SampleInfo info;
    while (reader->take_next_sample(&payload_, &info) ==
           eprosima::fastrtps::types::ReturnCode_t::RETCODE_OK) {
      const auto vector = info.valid_data ? daemon::decode<v1::Compensation>(payload_.bytes)
                                          : tl::make_unexpected(daemon::Error{});
      if (!vector) continue;
      // The feeder numbers every message: one Snapshot, and a ModelState each second, come between
      // two vectors.
      const auto now = static_cast<long>(vector->sequence_number());
      if (last_ != 0 && now > last_ + 3) count_.lost += (now - last_) / 2 - 1;
      last_ = now;
      ++count_.seen;
    }
  }

  mutable std::mutex mutex_;
  VectorCount count_;
  long last_ = 0;
  dds::Payload payload_;
  dds::Participant participant_;
  eprosima::fastdds::dds::DataReader* reader_ = nullptr;
};

}  // namespace
}  // namespace abbe::test

int main(int argc, char** argv) {
  if (argc < 3) return 2;
  const abbe::test::VectorCounter counter({.domain = static_cast<std::uint32_t>(std::atoi(argv[1])),
                                           .profiles = ABBE_LOOPBACK_PROFILE,
                                           .security = argv[2]});
  for (;;) {
    std::this_thread::sleep_for(std::chrono::milliseconds{200});
    const auto count = counter.count();
    std::printf("vectors %ld %ld\n", count.seen, count.lost);
    std::fflush(stdout);
  }
}
