#include "abbe/dds/readers.hpp"

#include <fastdds/dds/core/condition/GuardCondition.hpp>
#include <fastdds/dds/core/condition/StatusCondition.hpp>
#include <fastdds/dds/core/condition/WaitSet.hpp>
#include <fastdds/dds/core/status/LivelinessChangedStatus.hpp>
#include <fastdds/dds/domain/DomainParticipant.hpp>
#include <fastdds/dds/subscriber/DataReader.hpp>
#include <fastdds/dds/subscriber/DataReaderListener.hpp>
#include <fastdds/dds/subscriber/SampleInfo.hpp>
#include <fastdds/dds/subscriber/Subscriber.hpp>

#include <algorithm>
#include <map>
#include <mutex>
#include <set>
#include <string>
#include <utility>
#include <vector>

#include "abbe/dds/payload_type.hpp"
#include "abbe/dds/qos.hpp"
#include "abbe/result/try.hpp"

namespace abbe::dds {
namespace {

namespace fast = eprosima::fastdds::dds;
using Time = eprosima::fastrtps::rtps::Time_t;  // wall-clock time
const auto kOk = eprosima::fastrtps::types::ReturnCode_t::RETCODE_OK;

WriterId writer_id(const eprosima::fastrtps::rtps::InstanceHandle_t& publication) {
  WriterId id{};
  for (std::size_t i = 0; i < id.size(); ++i) id[i] = publication.value[i];
  return id;
}

/// The writers that keep their lease. This is a listener, called by Fast DDS from its own threads
/// for every change of a writer, because a status that is polled contains only the last change.
class AliveWriters final : public fast::DataReaderListener {
 public:
  [[nodiscard]] bool contains(const WriterId& writer) const {
    const std::lock_guard lock(mutex_);
    return alive_.contains(writer);
  }

  /// Triggered by every change of a writer. The reader's status condition cannot be used instead:
  /// the status is reset when Fast DDS passes it to the listener.
  fast::GuardCondition changed;

  /// Records that a sample of `writer` arrived at `arrived`: the writer is alive if it was not lost
  /// after that. Needed because Fast DDS may report that a writer is lost and alive again in the
  /// wrong order. A sample that had arrived before the loss, and is taken from the reader only now,
  /// does not make the writer alive.
  void heard(const WriterId& writer, const Time& arrived) {
    const std::lock_guard lock(mutex_);
    const auto lost = lost_at_.find(writer);
    if (lost != lost_at_.end() && !(lost->second < arrived)) return;
    if (lost != lost_at_.end()) lost_at_.erase(lost);
    // each writer is added again with its next sample
    if (alive_.size() >= kMostAlive) alive_.clear();
    alive_.insert(writer);
  }

 private:
  void on_liveliness_changed(fast::DataReader* /*reader*/,
                             const fast::LivelinessChangedStatus& status) override {
    const std::lock_guard lock(mutex_);
    const WriterId writer = writer_id(status.last_publication_handle);
    if (status.alive_count_change > 0) {
      alive_.insert(writer);
      lost_at_.erase(writer);
    }
    if (status.alive_count_change < 0) {
      alive_.erase(writer);
      Time::now(lost_at_[writer]);
      forget_oldest_loss();
    }
    changed.set_trigger_value(true);
  }

  /// Removes the oldest entry of lost_at_, because participants may come and go without end.
  void forget_oldest_loss() {
    constexpr std::size_t kMostLosses = 1024;
    if (lost_at_.size() <= kMostLosses) return;
    const auto earlier = [](const auto& a, const auto& b) { return a.second < b.second; };
    lost_at_.erase(std::ranges::min_element(lost_at_, earlier));
  }

  static constexpr std::size_t kMostAlive = 16384;  ///< more than the number of possible matches

  mutable std::mutex mutex_;
  std::set<WriterId> alive_;
  std::map<WriterId, Time> lost_at_;  ///< time at which the writer was last lost
};

}  // namespace

ParticipantId participant_of(const WriterId& writer) noexcept {
  ParticipantId id{};
  std::copy_n(writer.begin(), id.size(), id.begin());
  return id;
}

struct Readers::State {
  struct Reader {
    daemon::Topic topic;
    fast::DataReader* reader;
  };
  std::vector<Reader> readers;
  AliveWriters alive;
  fast::WaitSet waiting;
  fast::ConditionSeq active;
  Payload payload;

  State() { waiting.attach_condition(alive.changed); }
  ~State() {
    for (const Reader& r : readers) {
      r.reader->set_listener(nullptr);
      waiting.detach_condition(r.reader->get_statuscondition());
    }
    waiting.detach_condition(alive.changed);
  }

  void add(daemon::Topic topic, fast::DataReader* reader) {
    auto& condition = reader->get_statuscondition();
    condition.set_enabled_statuses(fast::StatusMask::data_available());
    waiting.attach_condition(condition);
    readers.push_back({topic, reader});
  }
};

Readers::Readers(std::unique_ptr<State> state) : state_(std::move(state)) {}
Readers::Readers(Readers&&) noexcept = default;
Readers& Readers::operator=(Readers&&) noexcept = default;
Readers::~Readers() = default;

Result<Readers> Readers::create(Participant& participant, std::span<const daemon::Topic> topics) {
  auto* subscriber = participant.get().create_subscriber(fast::SUBSCRIBER_QOS_DEFAULT);
  if (subscriber == nullptr) return fail(ErrorCode::Io, "subscriber: Fast DDS cannot create it");
  auto state = std::make_unique<State>();

  for (const daemon::Topic t : topics) {
    const auto topic = participant.topic(t);
    ABBE_TRY(topic);
    const bool is_state = t == daemon::Topic::ModelState;
    auto* reader =
        subscriber->create_datareader(*topic, reader_qos(t), is_state ? &state->alive : nullptr,
                                      fast::StatusMask::liveliness_changed());
    if (reader == nullptr) {
      return fail(ErrorCode::Io, "reader of " + std::string(daemon::traits(t).name) +
                                     ": Fast DDS cannot create it");
    }
    state->add(t, reader);
  }

  return Readers(std::move(state));
}

void Readers::wait(std::chrono::milliseconds at_most) {
  state_->waiting.wait(state_->active,
                       eprosima::fastrtps::Duration_t(static_cast<double>(at_most.count()) / 1e3));
  state_->alive.changed.set_trigger_value(false);
}

void Readers::take(const OnArrival& on_arrival) {
  // Takes a sample. Before it, the Identities that have arrived by then are taken, so that the
  // sample is judged by the identity that its publisher has at this moment.
  const auto take_next = [&](const State::Reader& r) {
    fast::SampleInfo info;
    if (r.reader->take_next_sample(&state_->payload, &info) != kOk) return false;
    if (!info.valid_data) return true;
    const WriterId writer = writer_id(info.publication_handle);
    if (r.topic == daemon::Topic::ModelState) state_->alive.heard(writer, info.reception_timestamp);
    on_arrival({r.topic, state_->payload.bytes, writer});
    return true;
  };
  const auto identity =
      std::ranges::find(state_->readers, daemon::Topic::Identity, &State::Reader::topic);
  const auto take_identities = [&] {
    while (identity != state_->readers.end() && take_next(*identity)) {
    }
  };

  for (const State::Reader& r : state_->readers) {
    do {
      take_identities();
    } while (take_next(r));
  }
}

bool Readers::is_alive(const WriterId& writer) const {
  return state_->alive.contains(writer);
}

}  // namespace abbe::dds
