#include "abbe/service/abbed.hpp"

#include <fmt/format.h>
#include <unistd.h>

#include <algorithm>
#include <array>
#include <chrono>
#include <cstdio>
#include <iterator>
#include <optional>
#include <utility>

#include "abbe/base/account_names.hpp"
#include "abbe/base/control_protocol.hpp"
#include "abbe/base/control_server.hpp"
#include "abbe/base/end_limits.hpp"
#include "abbe/base/exit_codes.hpp"
#include "abbe/base/exit_deadline.hpp"
#include "abbe/base/text_file.hpp"
#include "abbe/base/unix_socket.hpp"
#include "abbe/devices/device_set.hpp"
#include "abbe/drivers/cpu_latency.hpp"
#include "abbe/drivers/real_time_memory.hpp"
#include "abbe/pipeline/recording_rules.hpp"
#include "abbe/result/try.hpp"
#include "abbe/service/background_tasks.hpp"
#include "abbe/service/control_api.hpp"
#include "abbe/service/hub.hpp"
#include "abbe/service/journal_thread.hpp"
#include "abbe/service/process_signals.hpp"
#include "abbed_options.hpp"
#include "clock_watch.hpp"
#include "counting_upkeep.hpp"
#include "dds_side.hpp"
#include "hub_thread.hpp"
#include "observed_state.hpp"
#include "recording_upkeep.hpp"
#include "sensor_upkeep.hpp"
#include "store_upkeep.hpp"

namespace abbe::daemon {
namespace {

using namespace std::chrono_literals;
using WallTime = std::chrono::steady_clock::time_point;

constexpr auto kNameServiceTimeout = 1s;  // for requests at the start
constexpr int kHubHangs = number(ExitCode::Internal);

}  // namespace

// The parts are in the order of starting; they are destroyed in reverse order.
struct Abbed::State {
  Config config;
  AbbedOptions options;
  drivers::MonotonicTime time;
  WallClock clock;          // its first reading is at the start of abbed
  protocol::UtcOffset utc;  // offset for recordings and messages; constant
  std::vector<std::string> warnings;
  std::optional<drivers::CpuLatencyBound> cpu_latency;
  std::optional<ModelAuthority> authority;
  std::optional<IdentityWatch> machine_identity;
  std::unique_ptr<RecorderThread> recorder;
  std::optional<CalibrationService> calibration;
  std::optional<ReferenceService> reference;
  std::optional<SensorService> sensors;
  std::optional<VerificationService> verification;
  DdsSide dds;
  std::optional<DeviceSet> devices;
  std::optional<TouchService> touching;
  std::optional<TrackerService> tracker;
  std::optional<StoreChanges> store_changes;
  std::optional<Hub> hub;
  WallTime running_since;
  HubThread hub_thread;
  FileDescriptor control_listener;
  std::unique_ptr<ControlServer> control;
  std::optional<JournalThread> journal;
  CountingUpkeep counting_upkeep;
  SensorUpkeep sensor_upkeep{config, time};
  StoreUpkeep store_upkeep{config.daemon.models_dir(), config.models};
  const std::string recording = recording_name();
  RecordingUpkeep recording_upkeep{config, recording, clock};
  ClockWatch clock_watch{clock};
  bool has_ended = false;

  State(Config c, AbbedOptions o)
      : config(std::move(c)),
        options(std::move(o)),
        time(config.daemon.speed),
        clock(options.clock),
        utc(clock.offset(time.now())) {}
  State(const State&) = delete;
  State& operator=(const State&) = delete;
  ~State() { (void)end(); }

  /// Ends all parts. Further calls do nothing.
  std::optional<drivers::IppStop> end() {
    if (std::exchange(has_ended, true)) return {};
    if (devices) devices->end_machine();  // first: the machine must stop even if a later step hangs
    recording_upkeep.stop();
    end_hub();
    const auto machine = devices ? devices->finish_machine() : std::nullopt;
    counting_upkeep.end();  // waits for the disk
    return machine;
  }

  void end_hub() {
    const ExitDeadline deadline{
        kLongestHubEnd, kHubHangs,
        fmt::format("abbed: the hub does not end within {} s: exit code {}; what was "
                    "recorded stays readable in {}.mcap.part\n",
                    kLongestHubEnd.count(), kHubHangs, recording),
        &stop_machines_at_once};
    control.reset();
    journal.reset();  // both call the hub for the last time

    if (control_listener) ::unlink(config.control.socket.c_str());
    if (hub) hub->stop();
    hub_thread.end();
    counting_upkeep.hub_ended();
  }

  /// Checked before any socket is opened: a second abbed that tried to open the socket for abbe-dds
  /// would disconnect the first abbed from its abbe-dds.
  Result<void> refuse_second_daemon() {
    if (!is_listened_at(config.control.socket)) return {};
    return fail(ErrorCode::Io, fmt::format("listen {}: another daemon already answers there",
                                           config.control.socket.string()));
  }

  Result<void> open_recorder() {
    RecordingInfo info{.machine = config.machine.name,
                       .utc_offset = utc,
                       .speed = config.daemon.speed,
                       .configuration = options.configuration_text,
                       .versions = {{"abbe", ABBE_VERSION}}};
    std::ranges::move(recording_rules(), std::back_inserter(info.versions));
    auto opened = RecorderThread::start(recorder_options(config, recording), std::move(info));
    ABBE_TRY(opened);
    recorder = std::move(*opened);
    if (const auto status = recorder->status(); !status.fault.empty())
      warnings.push_back(fmt::format("nothing is recorded: {}", status.fault));
    return {};
  }

  Result<void> open_models() {
    authority.emplace(ModelAuthority::open(config.daemon.models_dir(), config, clock, time.now()));
    if (!authority->fault().empty()) warnings.push_back(authority->fault());
    return {};
  }

  /// Opens the identity of the machine. A failure does not stop the start, because acquisition and
  /// recording do not need the identity.
  Result<void> open_machine_identity() {
    machine_identity.emplace(
        IdentityWatch::open(config.daemon.data_dir, marks_of_this_computer(), utc_now()));
    authority->set_identity(&*machine_identity);
    const auto& known = machine_identity->known();
    if (!known.machine_id.empty())
      fmt::print(stderr, "abbed: machine {}, machine_id {}\n", config.machine.name,
                 known.machine_id);
    if (!known.doubt.empty()) warnings.push_back(known.doubt);
    if (known.doubt.empty() && !known.fault.empty())
      warnings.push_back(
          fmt::format("the machine has no identity beside its name: {}", known.fault));
    return {};
  }

  Result<void> open_dds() {
    return dds.open(config, options, machine_identity->known().machine_id, utc, warnings);
  }

  /// Limits the wake-up time of the processors. Called before start_devices(): a processor in a
  /// deep sleep state would delay the first time stamps of the devices.
  Result<void> bound_cpu_latency() {
    if (!config.daemon.cpu_latency) return {};
    auto bound = drivers::CpuLatencyBound::request(*config.daemon.cpu_latency);
    if (!bound) return refused_by_system({ErrorCode::Io, "cpu_latency_us: " + bound.error().text});
    cpu_latency.emplace(std::move(*bound));
    return {};
  }

  /// Handles a setting that the system refuses: an error if real time is enforced, else a warning.
  Result<void> refused_by_system(const Error& error) {
    if (config.daemon.realtime == RealTimeMode::Enforce) return tl::unexpected(error);
    warnings.push_back(error.text);
    return {};
  }

  Result<void> start_devices() {
    counting_upkeep.read(config, warnings);
    std::optional<CountingProgress> left;
    if (const auto& state = counting_upkeep.left()) left = state->counting.progress;
    auto started = DeviceSet::start(config, time, left);
    ABBE_TRY(started);
    devices.emplace(std::move(*started));
    const auto refused = devices->warnings();
    warnings.insert(warnings.end(), refused.begin(), refused.end());
    return {};
  }

  /// The thread waits until the hub exists. It is started earlier so that a refused priority is
  /// known before the recorder starts.
  Result<void> start_hub_thread() {
    const auto started = hub_thread.start(config.daemon);
    return started ? started : refused_by_system(started.error());
  }

  Result<void> listen_control() {
    auto listener = listen_unix(config.control.socket);
    ABBE_TRY(listener);
    control_listener = std::move(*listener);
    // The groups are looked up now, so that the first requests find them if the name service
    // answers in time.
    const std::array groups{config.control.look_group, config.control.change_group,
                            config.control.move_group};
    account_names().look_up(groups, kNameServiceTimeout);
    return {};
  }

  Result<void> run() {
    calibration.emplace(config, *authority, recorder.get(), clock);
    std::optional<Counting> left;
    if (const auto& state = counting_upkeep.left()) {
      recorder->attach(to_attachment(*state), time.now());
      left = state->counting;
    }

    auto left_sensors = sensor_upkeep.left(warnings);
    if (left_sensors) recorder->attach(*left_sensors, time.now());
    reference.emplace(config, recorder.get(), std::move(left));
    sensors.emplace(recorder.get());
    verification.emplace(config);
    touching.emplace(*devices, devices->moves());
    tracker.emplace(*devices, devices->longest_tracker_order());
    store_changes.emplace(config.daemon.models_dir());
    make_hub(std::move(left_sensors));
    running_since = WallTime::clock::now();
    hub_thread.run(*hub);
    recording_upkeep.start(running_since);

    control = serve_control(std::move(control_listener), config.control.socket,
                            [this](const nlohmann::json& request, const ControlPeer& peer) {
                              return answer_request(*hub, request, peer);
                            });

    journal.emplace(config.machine.name, open_journal(), [this] { return observe(); });
    counting_upkeep.start(config, *hub);

    return {};
  }

  void make_hub(std::optional<RecordingAttachment> sensors_left) {
    hub.emplace(HubParts{.config = config,
                         .time = time,
                         .devices = *devices,
                         .authority = *authority,
                         .calibration = *calibration,
                         .publisher = dds.publisher(),
                         .recorder = recorder.get(),
                         .reference = &*reference,
                         .touching = &*touching,
                         .verification = &*verification,
                         .tracker = &*tracker,
                         .store_changes = &*store_changes,
                         .network_user = dds.network_user(),
                         .identity = &*machine_identity,
                         .sensors = &*sensors,
                         .sensor_state = std::move(sensors_left)});
  }

  /// The state that the journal follows. Any thread except the hub's.
  Observed observe() {
    Observed now = observed_state(*hub);
    now.participant = dds.participant();
    return now;
  }
};

Result<std::unique_ptr<Abbed>> Abbed::start(Config config, AbbedOptions options) {
  drivers::keep_heap();
  auto state = std::make_unique<State>(std::move(config), std::move(options));
  prepare_background_tasks();

  use_dds_unit(state->config.dds, state->config.daemon.runtime_dir, state->options.dds_unit);
  for (const auto& directory :
       {state->config.daemon.runtime_dir, state->config.control.socket.parent_path(),
        state->config.dds.socket.parent_path()}) {
    ABBE_TRY(create_folder(directory, NewFolder::OfTheCaller));
  }

  using Step = Result<void> (State::*)();
  // The recorder is the last step that can fail, so that repeated failed starts leave no recording
  // files.
  for (const Step step :
       {&State::refuse_second_daemon, &State::open_models, &State::open_machine_identity,
        &State::open_dds, &State::bound_cpu_latency, &State::start_devices,
        &State::start_hub_thread, &State::listen_control, &State::open_recorder, &State::run}) {
    ABBE_TRY(((*state).*step)());
  }

  return std::unique_ptr<Abbed>{new Abbed{std::move(state)}};
}

Abbed::Abbed(std::unique_ptr<State> state) : state_(std::move(state)) {}
Abbed::~Abbed() = default;

void Abbed::cycle() {
  const auto now = WallTime::clock::now();
  state_->dds.cycle(now);
  state_->clock_watch.cycle(*state_->hub);
  state_->sensor_upkeep.cycle(now, *state_->hub);
  state_->recording_upkeep.cycle(now);
  state_->store_upkeep.cycle(now);
}

std::optional<drivers::IppStop> Abbed::end() {
  return state_->end();
}

void Abbed::stop_machine() {
  (void)state_->devices->stop_machine();
}

bool Abbed::alive() const {
  return WallTime::clock::now() - std::max(state_->hub->last_cycle(), state_->running_since) <
         Hub::kHangsAfter;
}

std::vector<std::string> Abbed::warnings() const {
  return state_->warnings;
}

}  // namespace abbe::daemon
