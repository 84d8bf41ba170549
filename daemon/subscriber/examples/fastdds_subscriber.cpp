// Shows how to apply abbe's correction, with Fast DDS and the types that fastddsgen generates from
// abbe_v1.idl:
//
//   fastdds_subscriber DOMAIN [PROFILES.xml [KEYS]] [--machine NAME MACHINE_ID]
//
// For every Compensation of every machine it prints whether it may be applied. It also prints when
// a vector that could be applied may no longer be applied, because no newer one has arrived. KEYS
// is the folder
// of one subscriber made by `abbe dds keys`; it is needed if abbed uses keys. MACHINE_ID is the
// identity of the machine NAME, from `abbe machine identity`; without it the first machine of each
// name is used, and no other one while the program runs. PROFILES.xml has a participant profile
// "abbe"; without it UDP on all interfaces is used. Fast DDS calls the listener from its own
// threads. As a last defence against foreign participants, limit the memory of the process, for
// example with MemoryMax= of its systemd unit.
//
// Exit codes: 2 a wrong argument, 3 an unusable PROFILES.xml, 4 Fast DDS refuses.
#include <fastdds/rtps/transport/UDPv4TransportDescriptor.h>
#include <abbe/subscriber/message_filter.hpp>
#include <abbe/subscriber/publisher_pin.hpp>
#include <algorithm>
#include <charconv>
#include <chrono>
#include <cstdint>
#include <cstdio>
#include <cstdlib>
#include <exception>
#include <fastdds/dds/domain/DomainParticipant.hpp>
#include <fastdds/dds/domain/DomainParticipantFactory.hpp>
#include <fastdds/dds/subscriber/DataReader.hpp>
#include <fastdds/dds/subscriber/DataReaderListener.hpp>
#include <fastdds/dds/subscriber/SampleInfo.hpp>
#include <fastdds/dds/subscriber/Subscriber.hpp>
#include <map>
#include <memory>
#include <mutex>
#include <optional>
#include <set>
#include <string>
#include <string_view>
#include <thread>

#include "abbe_v1PubSubTypes.h"

using namespace eprosima::fastdds::dds;
using abbe::dds::ParticipantId;
using abbe::dds::PublisherPin;
using abbe::dds::text_of;
using abbe::dds::twin_of;
using abbe::v1::Compensation;
using abbe::v1::Identity;
using abbe::v1::ModelState;
using Writer = InstanceHandle_t;  // a DDS writer, by its GUID

namespace {

using SteadyClock = std::chrono::steady_clock;

/// A publisher whose last ModelState is older counts as not alive: abbe-dds repeats ModelState
/// every second, even if nothing in it changes.
constexpr std::chrono::milliseconds kLongestSilence{1500};

/// Delay of a vector from publication to now, relative to the fastest vector of its publisher. The
/// delay includes the network, the time in the socket while this process was suspended, and the
/// wait for the lock. The clocks of the two computers may differ in offset, and in rate by 200 ppm.
class Delay {
 public:
  std::int64_t of_ns(const Compensation& c) {
    constexpr std::int64_t kSecond_ns = 1'000'000'000;
    const std::int64_t now_ns = SteadyClock::now().time_since_epoch().count();
    const std::int64_t offset_ns = now_ns - (c.host_time_ns() + c.age_ns());
    // After a change of publisher: if the new one's first vector gives a clock offset plus transit
    // time that differs by more than 20 ms from that of the previous publisher, the new publisher
    // has another clock, and the measurement starts again.
    if (inherited_ && std::abs(offset_ns - least_ns_) > kSecond_ns / 50) first_ns_ = 0;
    inherited_ = false;
    if (first_ns_ == 0) first_ns_ = last_ns_ = now_ns, least_ns_ = offset_ns;
    least_ns_ = std::min(offset_ns, least_ns_ + std::min(now_ns - last_ns_, kSecond_ns) / 5000);
    last_ns_ = now_ns;
    known_ = now_ns - first_ns_ > kSecond_ns / 5;
    return offset_ns - least_ns_;
  }
  /// True 0.2 s after the first vector: the fastest vector of this time serves as the reference. A
  /// single vector would not suffice, because it may be late.
  [[nodiscard]] bool known() const { return known_; }
  /// The initial measurement for the next publisher, whose clock is the same if abbe-dds only
  /// restarted.
  [[nodiscard]] Delay for_next_publisher() const {
    Delay next = *this;
    next.inherited_ = next.first_ns_ != 0;
    return next;
  }

 private:
  bool known_ = false, inherited_ = false;
  std::int64_t first_ns_ = 0, last_ns_ = 0, least_ns_ = 0;
};

/// State of one publisher (a DDS participant) of one machine, independent of other publishers.
struct Publisher {
  ModelState state;
  Writer state_from;  ///< writer of `state`; unknown: there is no valid state
  SteadyClock::time_point heard{};
  Delay delay;
};

/// The last vector of a machine, while it may be applied.
struct Applied {
  Compensation vector;
  std::int64_t age_ns;  ///< age of the vector when it arrived
  SteadyClock::time_point arrived;
};

/// One of the machines whose data are published in the domain. Only samples of its pinned publisher
/// are used (publisher_pin.hpp).
struct Machine {
  PublisherPin pin;
  std::map<ParticipantId, Publisher> publishers;
  std::optional<SteadyClock::time_point> ignored_publisher_reported;
  std::optional<Applied> applied;
};

/// The rule of abbe_v1.idl: nullptr if the vector may be applied, else the reason why not. `alive`:
/// the writer of the state is alive (DDS liveliness). `age_ns`: age of the vector including the
/// delay after its publication.
const char* why_not(const Compensation& c, std::int64_t age_ns, const Publisher& publisher,
                    bool alive) {
  const ModelState& state = publisher.state;
  if (!alive) return "the ModelState publisher is not alive";
  if (state.state() != abbe::v1::MODEL_ACTIVE || c.state() != abbe::v1::MODEL_ACTIVE)
    return "the model is not ACTIVE";
  if (c.model_id() != state.model_id()) return "the vector is of another model";
  if (!c.inside()) return "outside the volume of the calibration data";
  if (!c.tool_ok()) return "the model is not valid for this tool";
  if (!publisher.delay.known()) return "the reference delay is not known yet";
  if (age_ns > c.validity_ns()) return "too old";
  return nullptr;
}

class Listener : public DataReaderListener {
 public:
  /// `machine_ids`: identities by machine name, for machines whose identity is given.
  explicit Listener(std::map<std::string, std::string> machine_ids)
      : machine_ids_(std::move(machine_ids)) {}

  /// Call it every few milliseconds: a publisher that has ended sends nothing more, so that no
  /// sample shows that its last vector may not be applied any more.
  void withdraw() {
    const std::lock_guard lock(mutex_);
    for (auto& [name, machine] : machines_) {
      if (!machine.applied) continue;
      const char* reason = why_not_any_more(machine);
      if (reason == nullptr) continue;
      std::printf("%s: do not apply: %s\n", name.c_str(), reason);
      machine.applied.reset();
    }
  }

 private:
  /// The reason why the last vector may no longer be applied; nullptr: it may still be applied.
  const char* why_not_any_more(Machine& machine) const {
    const auto pinned = machine.pin.pinned();
    if (!pinned) return "the publisher states another machine";
    const Publisher& publisher = machine.publishers[*pinned];
    const Applied& applied = *machine.applied;
    const std::chrono::nanoseconds since = SteadyClock::now() - applied.arrived;
    return why_not(applied.vector, applied.age_ns + since.count(), publisher, is_alive(publisher));
  }

  /// Called by Fast DDS when a writer of ModelState loses or regains its liveliness. The state from
  /// a writer that lost it is discarded; a writer that regains it repeats its state within a
  /// second.
  void on_liveliness_changed(DataReader*, const LivelinessChangedStatus& status) override {
    const std::lock_guard lock(mutex_);
    const Writer writer = status.last_publication_handle;
    // each writer is added again with its next state, within a second
    if (alive_.size() > 4096) alive_.clear();
    if (status.alive_count_change > 0) alive_.insert(writer);
    if (status.alive_count_change >= 0) return;
    alive_.erase(writer);
    for (auto& [name, machine] : machines_) {
      for (auto& [id, publisher] : machine.publishers) {
        if (publisher.state_from != writer) continue;
        publisher.state_from = Writer();
        if (machine.pin.pinned() == id) std::printf("%s: not alive\n", name.c_str());
      }
    }
  }

  void on_data_available(DataReader* reader) override {
    const std::lock_guard lock(mutex_);
    const std::string topic = reader->get_topicdescription()->get_name();
    if (topic == "abbe/v1/Identity")
      take<Identity>(reader, [this](const auto& m, auto& writer) { identify(m, writer); });
    if (topic == "abbe/v1/ModelState")
      take<ModelState>(reader, [this](const auto& m, auto& writer) { keep(m, writer); });
    if (topic == "abbe/v1/Compensation")
      take<Compensation>(reader, [this](const auto& m, auto& writer) { decide(m, writer); });
  }

  template <class Sample, class Use>
  static void take(DataReader* reader, Use use) {
    SampleInfo info;
    Sample sample;
    while (reader->take_next_sample(&sample, &info) == ReturnCode_t::RETCODE_OK)
      if (info.valid_data && sample.machine().size() > 0) use(sample, info.publication_handle);
  }

  struct Source {
    Publisher& publisher;
    bool pinned;  ///< if false, its samples are kept but not used
  };
  /// `identity`: the sample, if it is an Identity.
  Source heard(const std::string& name, const Writer& writer, const Identity* identity = nullptr) {
    using Verdict = PublisherPin::Verdict;
    ParticipantId id{};
    for (std::size_t i = 0; i < id.size(); ++i) id[i] = writer.value[i];
    Machine& machine =
        machines_.try_emplace(name, Machine{.pin = PublisherPin(machine_id_of(name))})
            .first->second;
    const auto former = machine.pin.pinned();
    const auto now = SteadyClock::now();
    const Verdict verdict =
        identity == nullptr
            ? machine.pin.heard(id, now)
            : machine.pin.identified(id, identity->machine_id().to_string(),
                                     twin_of(identity->twin(), identity->twin_seen().c_str(), name),
                                     now);
    const auto [found, is_new] = machine.publishers.try_emplace(id);
    if (is_new && former)
      found->second.delay = machine.publishers[*former].delay.for_next_publisher();
    if (verdict == Verdict::NewlyPinned) {
      std::printf(
          "%s: publisher is %s%s\n", name.c_str(), text_of(id).c_str(),
          machine.pin.machine_id() ? "" : ", an abbe-dds of an earlier version without identity");
      if (found->second.state_from != Writer()) print_state(found->second.state);
    }
    if (verdict == Verdict::Foreign)
      report_ignored_publisher(name, machine, id, "another publisher");
    if (verdict == Verdict::OtherMachine)
      report_ignored_publisher(name, machine, id, "another machine of this name, publisher");
    if (verdict == Verdict::Ambiguous)
      report_ignored_publisher(name, machine, id,
                               "one of several machines of this name, publisher");
    if (verdict == Verdict::Copied)
      report_ignored_publisher(name, machine, id, "one of several with one identity, publisher");
    if (verdict == Verdict::Unidentified)
      report_ignored_publisher(name, machine, id, "without a machine_id, publisher");
    std::erase_if(machine.publishers,
                  [&](const auto& p) { return !machine.pin.remembers(p.first); });

    return {found->second, machine.pin.pinned() == id};
  }

  /// True if the machine is stored: one of the given machines; or, if none was given, one of the
  /// first 256, because any participant may publish any number of names.
  [[nodiscard]] bool has_place(const std::string& name) const {
    if (!machine_ids_.empty()) return machine_ids_.contains(name);
    return machines_.size() < 256 || machines_.contains(name);
  }

  [[nodiscard]] std::string machine_id_of(const std::string& name) const {
    const auto given = machine_ids_.find(name);
    return given == machine_ids_.end() ? std::string() : given->second;
  }

  /// Prints at most every 10 s that the samples of a publisher of this machine are not used.
  /// (`abbe watch` also prints the network address of that publisher.)
  static void report_ignored_publisher(const std::string& name, Machine& machine,
                                       const ParticipantId& id, const char* what) {
    constexpr std::chrono::seconds kReportPeriod{10};
    const auto now = SteadyClock::now();
    if (machine.ignored_publisher_reported &&
        now - *machine.ignored_publisher_reported < kReportPeriod)
      return;
    machine.ignored_publisher_reported = now;
    std::printf("%s: %s %s is ignored\n", name.c_str(), what, text_of(id).c_str());
  }

  /// Evaluates an Identity, which states the machine of a publisher.
  void identify(const Identity& identity, const Writer& writer) {
    const std::string name = identity.machine().to_string();
    if (has_place(name)) heard(name, writer, &identity);
  }

  /// Keeps a ModelState, also one from a publisher that is not pinned, because it may be pinned
  /// later.
  void keep(const ModelState& state, const Writer& writer) {
    const std::string name = state.machine().to_string();
    if (!has_place(name)) return;
    const auto [publisher, pinned] = heard(name, writer);
    publisher.state = state;
    publisher.state_from = writer;
    publisher.heard = SteadyClock::now();
    alive_.insert(writer);  // Fast DDS may report simultaneous changes in the wrong order
    if (pinned) print_state(state);
  }

  static void print_state(const ModelState& state) {
    std::printf("%s: state %u %s\n", state.machine().c_str(), static_cast<unsigned>(state.state()),
                state.reason().c_str());
  }

  void decide(const Compensation& c, const Writer& writer) {
    const std::string name = c.machine().to_string();
    if (!has_place(name)) return;
    const auto [publisher, pinned] = heard(name, writer);
    const std::int64_t age_ns = c.age_ns() + publisher.delay.of_ns(c);
    if (!pinned) return;
    auto& applied = machines_[name].applied;
    applied.reset();
    if (const char* reason = why_not(c, age_ns, publisher, is_alive(publisher))) {
      std::printf("%s: do not apply: %s\n", name.c_str(), reason);
    } else {
      applied = {c, age_ns, SteadyClock::now()};
      const double age_ms = static_cast<double>(age_ns) * 1e-6;
      std::printf("%s: apply V = %.3f %.3f %.3f um, %.3f ms old\n", name.c_str(),
                  c.vector_m()[0] * 1e6, c.vector_m()[1] * 1e6, c.vector_m()[2] * 1e6, age_ms);
    }
  }

  [[nodiscard]] bool is_alive(const Publisher& publisher) const {
    return alive_.contains(publisher.state_from) &&
           SteadyClock::now() - publisher.heard < kLongestSilence;
  }

  std::map<std::string, std::string> machine_ids_;
  std::mutex mutex_;
  std::map<std::string, Machine> machines_;
  std::set<Writer> alive_;  ///< writers of ModelState that are alive
};

/// Switches DDS Security on: only participants with keys of the same authority can then publish to
/// this participant or read from it.
void use_keys(const std::string& folder, DomainParticipantQos& qos) {
  const std::string auth = "dds.sec.auth.builtin.PKI-DH.";
  const std::string access = "dds.sec.access.builtin.Access-Permissions.";
  const std::string file = "file://" + folder + "/";
  auto& properties = qos.properties().properties();
  properties.emplace_back("dds.sec.auth.plugin", "builtin.PKI-DH");
  properties.emplace_back(auth + "identity_ca", file + "identity_ca.crt");
  properties.emplace_back(auth + "identity_certificate", file + "identity.crt");
  properties.emplace_back(auth + "private_key", file + "identity.key");
  properties.emplace_back("dds.sec.access.plugin", "builtin.Access-Permissions");
  properties.emplace_back(access + "permissions_ca", file + "permissions_ca.crt");
  properties.emplace_back(access + "governance", file + "governance.p7s");
  properties.emplace_back(access + "permissions", file + "permissions.p7s");
  properties.emplace_back("dds.sec.crypto.plugin", "builtin.AES-GCM-GMAC");
}

/// Number of instances into which readers divide the received samples.
constexpr int kInstances = 1024;
/// Most participants and most writers of a topic that are kept, and most endpoints of each
/// participant on average.
constexpr std::size_t kMostParticipants = 512, kMostEndpointsEach = 16;

/// Sets limits for the memory. Without them, another participant that announces participants and
/// writers without end would exhaust the memory.
void limit_memory(DomainParticipantQos& qos) {
  qos.allocation().participants.maximum = kMostParticipants;
  qos.allocation().readers.maximum = qos.allocation().writers.maximum = kMostEndpointsEach;
}

/// Some messages that any participant of the domain can send crash Fast DDS 2.9. The filter removes
/// them (abbe/subscriber/message_filter.hpp).
void filter_messages(DomainParticipantQos& qos, bool secured) {
  auto& transports = qos.transport();
  if (transports.user_transports.empty()) {
    transports.use_builtin_transports = false;
    transports.user_transports.push_back(
        std::make_shared<eprosima::fastdds::rtps::UDPv4TransportDescriptor>());
  }
  using abbe::dds::
      Protection;  // the governance of `abbe dds keys` requires that every message is signed
  const auto protection = secured ? Protection::Messages : Protection::None;
  const auto window = secured ? nullptr : std::make_shared<abbe::dds::SequenceWindow>();
  for (auto& transport : transports.user_transports)
    transport = abbe::dds::with_message_filter(transport, protection, window);
}

/// A generated type whose deserialize() does not throw: any participant of the domain may send
/// bytes that are no valid message, and an exception in a thread of Fast DDS ends the process. Such
/// a sample becomes an empty one, without machine. (With `false` instead Fast DDS would keep it as
/// the next sample.)
/// The key is reduced to kInstances values by a hash of the generated key, because participants may
/// publish any number of keys, and Fast DDS 2.9 aborts when its table of instances is full. If two
/// machines have the same value, the later sample replaces an earlier one that was not taken yet.
template <class GeneratedType>
class Checked final : public GeneratedType {
  bool getKey(void* data, InstanceHandle_t* handle, bool /*force_md5*/) override {
    InstanceHandle_t key;
    if (!GeneratedType::getKey(data, &key, true)) return false;
    const int index = (key.value[0] << 8 | key.value[1]) % kInstances;
    *handle = InstanceHandle_t();
    handle->value[0] = 1;  // a handle of zeros means "none"
    handle->value[14] = static_cast<std::uint8_t>(index >> 8);
    handle->value[15] = static_cast<std::uint8_t>(index & 0xff);
    return true;
  }
  bool deserialize(eprosima::fastrtps::rtps::SerializedPayload_t* payload, void* data) override {
    try {
      if (GeneratedType::deserialize(payload, data)) return true;
    } catch (const std::exception&) {
    }
    *static_cast<typename GeneratedType::type*>(data) = {};
    return true;
  }
};

/// Prevents that Fast DDS announces a TypeObject, which Cyclone DDS does not accept and which may
/// crash older versions of Fast DDS.
TypeSupport without_type_object(TopicDataType* type) {
  type->auto_fill_type_information(false);
  type->auto_fill_type_object(false);
  return TypeSupport(type);
}

bool read_topic(DomainParticipant* participant, Subscriber* subscriber, TypeSupport type,
                const char* topic_name, const DataReaderQos& qos, DataReaderListener* listener) {
  type.register_type(participant);
  Topic* topic = participant->create_topic(topic_name, type.get_type_name(), TOPIC_QOS_DEFAULT);
  return topic != nullptr && subscriber->create_datareader(topic, qos, listener) != nullptr;
}

/// The domain in a decimal number; nullopt unless its ports exist [DDSI-RTPS 2.5, 9.6.2].
std::optional<unsigned> domain_of(std::string_view text) {
  constexpr unsigned kHighest = 232;
  unsigned domain = 0;
  const auto [end, error] = std::from_chars(text.data(), text.data() + text.size(), domain);
  const bool is_number = error == std::errc() && end == text.data() + text.size();
  return is_number && domain <= kHighest ? std::optional(domain) : std::nullopt;
}

int refuse(int exit_code, const std::string& why) {
  std::fprintf(stderr, "fastdds_subscriber: %s\n", why.c_str());
  if (exit_code == 2)
    std::fputs(
        "usage: fastdds_subscriber DOMAIN [PROFILES.xml [KEYS]] [--machine NAME MACHINE_ID]\n",
        stderr);
  return exit_code;
}

}  // namespace

int main(int argc, char** argv) {
  std::setvbuf(stdout, nullptr, _IOLBF, 0);
  std::map<std::string, std::string> machine_ids;
  if (argc > 3 && std::string(argv[argc - 3]) == "--machine") {
    machine_ids[argv[argc - 2]] = argv[argc - 1];
    argc -= 3;
    if (machine_ids.begin()->second.empty()) return refuse(2, "MACHINE_ID is empty");
  }
  if (argc < 2 || argc > 4) return refuse(2, "wrong number of arguments");
  const auto domain = domain_of(argv[1]);
  if (!domain) return refuse(2, "DOMAIN is not a number from 0 to 232");

  auto* factory = DomainParticipantFactory::get_instance();
  DomainParticipantQos participant_qos;
  // The default lease of 20 s may be shorter than a suspension of this process. abbe-dds would then
  // drop this participant, which would not announce its readers again.
  participant_qos.wire_protocol().builtin.discovery_config.leaseDuration =
      eprosima::fastrtps::Duration_t(40, 0);
  if (argc > 2 && (factory->load_XML_profiles_file(argv[2]) != ReturnCode_t::RETCODE_OK ||
                   factory->get_participant_qos_from_profile("abbe", participant_qos) !=
                       ReturnCode_t::RETCODE_OK)) {
    return refuse(3, std::string("no participant profile \"abbe\" can be read from ") + argv[2]);
  }
  // Number of ports that Fast DDS tries. With its default of 100, participants after the first
  // hundred on a computer would receive nothing, and no error would be reported.
  participant_qos.wire_protocol().builtin.mutation_tries = 400;
  limit_memory(participant_qos);
  if (argc > 3) use_keys(argv[3], participant_qos);
  filter_messages(participant_qos, argc > 3);
  auto* participant = factory->create_participant(*domain, participant_qos);
  if (participant == nullptr)
    return refuse(4, "cannot join domain " + std::to_string(*domain) +
                         (argc > 3 ? std::string(" with the keys in ") + argv[3] : ""));
  static Listener listener(machine_ids);
  auto* subscriber = participant->create_subscriber(SUBSCRIBER_QOS_DEFAULT);

  DataReaderQos live;  // best effort, volatile, keep last 1
  live.resource_limits().max_samples = live.resource_limits().max_instances = kInstances;
  live.resource_limits().max_samples_per_instance = 1;
  live.reader_resource_limits().matched_publisher_allocation.maximum = kMostParticipants;
  DataReaderQos durable = live;
  durable.reliability().kind = RELIABLE_RELIABILITY_QOS;
  durable.durability().kind = TRANSIENT_LOCAL_DURABILITY_QOS;
  const DataReaderQos retained = durable;
  // abbe-dds asserts liveliness only while abbed is alive
  durable.liveliness().kind = MANUAL_BY_TOPIC_LIVELINESS_QOS;
  durable.liveliness().lease_duration = eprosima::fastrtps::Duration_t(1, 0);

  const bool ok = read_topic(participant, subscriber,
                             without_type_object(new Checked<abbe::v1::ModelStatePubSubType>),
                             "abbe/v1/ModelState", durable, &listener) &&
                  read_topic(participant, subscriber,
                             without_type_object(new Checked<abbe::v1::IdentityPubSubType>),
                             "abbe/v1/Identity", retained, &listener) &&
                  read_topic(participant, subscriber,
                             without_type_object(new Checked<abbe::v1::CompensationPubSubType>),
                             "abbe/v1/Compensation", live, &listener);
  if (!ok) return refuse(4, "cannot read the topics");
  std::puts("waiting; end with Ctrl-C");
  for (;;) {
    std::this_thread::sleep_for(std::chrono::milliseconds{5});
    listener.withdraw();
  }
}
