#include "abbe/service/abbed.hpp"

#include <fmt/format.h>
#include <pthread.h>
#include <sched.h>
#include <sys/stat.h>
#include <unistd.h>

#include <algorithm>
#include <array>
#include <atomic>
#include <chrono>
#include <cstdio>
#include <cstring>
#include <ctime>
#include <exception>
#include <filesystem>
#include <future>
#include <iterator>
#include <mutex>
#include <optional>
#include <thread>
#include <utility>

#include "abbe/base/account_names.hpp"
#include "abbe/base/clock_steps.hpp"
#include "abbe/base/control_protocol.hpp"
#include "abbe/base/control_server.hpp"
#include "abbe/base/end_limits.hpp"
#include "abbe/base/exit_codes.hpp"
#include "abbe/base/exit_deadline.hpp"
#include "abbe/base/text_file.hpp"
#include "abbe/base/unix_socket.hpp"
#include "abbe/config/capabilities.hpp"
#include "abbe/devices/device_set.hpp"
#include "abbe/drivers/cpu_latency.hpp"
#include "abbe/drivers/real_time_memory.hpp"
#include "abbe/messages/dds_security.hpp"
#include "abbe/pipeline/recording_rules.hpp"
#include "abbe/pipeline/sensor_state_file.hpp"
#include "abbe/publishing/dds_supervisor.hpp"
#include "abbe/recording/left_recordings.hpp"
#include "abbe/recording/old_recordings.hpp"
#include "abbe/recording/recorded_clock.hpp"
#include "abbe/result/try.hpp"
#include "abbe/service/background_tasks.hpp"
#include "abbe/service/control_api.hpp"
#include "abbe/service/counting_state_thread.hpp"
#include "abbe/service/hub.hpp"
#include "abbe/service/journal_thread.hpp"
#include "abbe/service/process_signals.hpp"
#include "abbed_options.hpp"
#include "model_status_name.hpp"
#include "outcome.hpp"
#include "store_upkeep.hpp"

namespace abbe::daemon {
namespace {

using namespace std::chrono_literals;
using WallTime = std::chrono::steady_clock::time_point;

constexpr auto kSensorsWritten = 5s;
/// The end of abbed waits for a hub that hangs no longer than this because of them.
constexpr auto kSensorsTimeout = 100ms;
constexpr auto kTidyPeriod = 1h;    // period of the search for old recordings
constexpr auto kTidyFirst = 10min;  // time for a time server to correct the clock after boot
constexpr auto kHubTimeout = 1s;    // thousands of cycles; without an answer for this long it hangs
constexpr auto kNameServiceTimeout = 1s;  // at the start
constexpr int kHubHangs = number(ExitCode::Internal);

/// nullopt until the outcome of the latest request to stop the machine is known.
std::optional<ObservedStop> observed_stop(const drivers::IppStop& stop) {
  using enum drivers::IppStopOutcome;
  if (stop.outcome == None || stop.outcome == Pending) return std::nullopt;
  return ObservedStop{.number = stop.number,
                      .outcome = name_of(stop.outcome),
                      .text = stop.text,
                      .confirmed = stop.outcome == Stopped};
}

/// "abbe-2026-11-21T03-40-12Z-4711": readable, sorts by time, unique for each daemon process.
std::string recording_name() {
  const std::time_t now = std::chrono::system_clock::to_time_t(std::chrono::system_clock::now());
  std::tm utc{};
  ::gmtime_r(&now, &utc);
  return fmt::format("abbe-{:04}-{:02}-{:02}T{:02}-{:02}-{:02}Z-{}", utc.tm_year + 1900,
                     utc.tm_mon + 1, utc.tm_mday, utc.tm_hour, utc.tm_min, utc.tm_sec, ::getpid());
}

/// The hub is soft real time: above the ordinary programs, below the devices. A refusal is a
/// warning in mode `ignore`.
Result<void> set_priority(std::thread& thread, const DaemonConfig& config) {
  sched_param parameters{};
  parameters.sched_priority = config.hub_priority;
  int error = ::pthread_setschedparam(thread.native_handle(), SCHED_FIFO, &parameters);
  if (error == 0 && config.hub_cpu) {
    cpu_set_t cpus;
    CPU_ZERO(&cpus);
    CPU_SET(*config.hub_cpu, &cpus);
    error = ::pthread_setaffinity_np(thread.native_handle(), sizeof cpus, &cpus);
  }
  if (error == 0) return {};
  return fail(ErrorCode::Io, fmt::format("hub thread: SCHED_FIFO {}: {}", config.hub_priority,
                                         std::strerror(error)));
}

}  // namespace

// In the order of starting; destroyed in reverse.
struct Abbed::State {
  Config config;
  AbbedOptions options;
  drivers::MonotonicTime time;
  WallClock clock;          // first reading: the start of abbed
  protocol::UtcOffset utc;  // of recordings and messages, constant
  std::vector<std::string> warnings;
  std::optional<drivers::CpuLatencyBound> cpu_latency;
  std::optional<ModelAuthority> authority;
  std::optional<IdentityWatch> machine_identity;
  std::unique_ptr<RecorderThread> recorder;
  std::optional<CalibrationService> calibration;
  std::optional<ReferenceService> reference;
  std::optional<SensorService> sensors;
  std::optional<VerificationService> verification;
  DdsProcess dds_process;
  std::optional<uid_t> network_user;  ///< of abbe-dds, if it has a user of its own
  std::optional<Publisher> publisher;
  std::optional<DdsSupervisor> supervisor;
  std::optional<DeviceSet> devices;
  std::optional<TouchService> touching;
  std::optional<TrackerService> tracker;
  std::optional<StoreChanges> store_changes;
  std::optional<Hub> hub;
  WallTime running_since;
  std::promise<void> hub_may_run;  // broken if the start of abbed failed
  std::thread hub_thread;
  std::atomic<bool> hub_has_ended{false};
  FileDescriptor control_listener;
  std::unique_ptr<ControlServer> control;
  std::mutex participant_mutex;
  std::optional<ObservedParticipant> participant;  // under participant_mutex
  std::optional<JournalThread> journal;
  const std::string boot = boot_id();
  LeftCounting left_counting;
  std::optional<CountingStateThread> counting_state;
  std::future<Result<void>> writing_sensors;
  std::string sensors_fault;  ///< as reported
  WallTime next_sensors = WallTime::clock::now() + kSensorsWritten;
  std::future<Result<std::vector<std::filesystem::path>>> tidying;
  StoreUpkeep store_upkeep{config.daemon.models_dir(), config.models};
  // Owned by the background task, which the end of abbed does not wait for.
  const std::shared_ptr<std::atomic<bool>> stop_closing =
      std::make_shared<std::atomic<bool>>(false);
  std::future<Result<std::vector<LeftRecording>>> closing_left;
  const std::string recording = recording_name();
  ClockSteps clock_steps{clock.read()};
  ClockChange clock_change{};  // as reported
  bool tidies = true;          // false after the clock was set
  bool has_ended = false;
  WallTime next_tidying = WallTime::clock::now() + kTidyFirst;

  State(Config c, AbbedOptions o)
      : config(std::move(c)),
        options(std::move(o)),
        time(config.daemon.speed),
        clock(options.clock),
        utc(clock.offset(time.now())) {}
  State(const State&) = delete;
  State& operator=(const State&) = delete;
  ~State() { (void)end(); }

  /// The first call ends everything.
  std::optional<drivers::IppStop> end() {
    if (std::exchange(has_ended, true)) return {};
    if (devices) devices->end_machine();  // first: the machine must stop even if a later step hangs
    *stop_closing = true;
    end_hub();
    const auto machine = devices ? devices->finish_machine() : std::nullopt;
    counting_state.reset();  // waits for the disk
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
    journal.reset();  // both call the hub a last time

    if (control_listener) ::unlink(config.control.socket.c_str());
    if (hub) hub->stop();
    hub_may_run = {};
    if (hub_thread.joinable()) hub_thread.join();
    hub_has_ended.store(true,
                        std::memory_order_release);  // pairs with the acquire in look_at_counting()
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

  /// Nothing is refused: acquisition and recording do not need the identity.
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
    if (config.dds.supervise == Supervise::Off) return {};
    if (options.dds_unit && config.dds.supervise == Supervise::Child)
      warnings.emplace_back(
          "[dds] supervise = \"child\": abbe-dds, which reads the network, runs with the rights of "
          "abbed; remove this line, and it runs as a user of its own");
    const bool supervised = config.dds.supervise == Supervise::Child;
    const auto peer = dds_peer();
    ABBE_TRY(peer);
    auto link = DdsLink::listen(config.dds.socket, *peer);
    ABBE_TRY(link);
    auto publishes = publisher_options(config);
    publishes.identity.machine_id = machine_identity->known().machine_id;
    publisher.emplace(std::move(*link), std::move(publishes), utc);
    check_dds_security();
    if (!supervised) return {};
    auto started = DdsSupervisor::start(abbe_dds_options(config, options.dds_program, dds_process),
                                        WallTime::clock::now());
    ABBE_TRY(started);
    supervisor.emplace(std::move(*started));

    return {};
  }

  /// The process that may connect to the socket for abbe-dds.
  Result<DdsLinkPeer> dds_peer() {
    if (config.dds.supervise == Supervise::Child) return DdsLinkPeer{.process = &dds_process};
    if (config.dds.user.empty()) return DdsLinkPeer{};
    const auto account = account_of(config.dds.user);
    if (!account)
      return fail(
          ErrorCode::Io,
          fmt::format("[dds] user: there is no user \"{}\", as which systemd runs abbe-dds: "
                      "systemd-sysusers makes it",
                      config.dds.user));
    if (account->uid != ::geteuid()) network_user = account->uid;
    return DdsLinkPeer{.user = account};
  }

  /// Warns only: acquisition and recording do not need abbe-dds, and abbe-dds itself refuses
  /// unusable keys.
  void check_dds_security() {
    if (!dds_is_secured(config.dds.security, config.dds.profile)) {
      warnings.push_back(dds_security_is_off(config.dds.domain));
    } else if (!config.dds.security.empty() && !network_user) {  // else only abbe-dds can read it
      const auto keys =
          find_dds_identity(config.dds.security, DdsRole::Daemon, std::chrono::system_clock::now());
      if (!keys)
        warnings.push_back(keys.error().text +
                           "; nothing is published over DDS until this is corrected");
    }
  }

  /// Called before start_devices(): a processor in a deep sleep state would delay the first time
  /// stamps of the devices.
  Result<void> bound_cpu_latency() {
    if (!config.daemon.cpu_latency) return {};
    auto bound = drivers::CpuLatencyBound::request(*config.daemon.cpu_latency);
    if (!bound) return refused_by_system({ErrorCode::Io, "cpu_latency_us: " + bound.error().text});
    cpu_latency.emplace(std::move(*bound));
    return {};
  }

  /// An error where real time is enforced, else a warning.
  Result<void> refused_by_system(const Error& error) {
    if (config.daemon.realtime == RealTimeMode::Enforce) return tl::unexpected(error);
    warnings.push_back(error.text);
    return {};
  }

  Result<void> start_devices() {
    left_counting = daemon::left_counting(config, boot);
    if (!left_counting.warning.empty()) warnings.push_back(left_counting.warning);
    std::optional<CountingProgress> left;
    if (left_counting.state) left = left_counting.state->counting.progress;
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
    hub_thread =
        std::thread([this, may_run = hub_may_run.get_future()]() mutable { run_hub(may_run); });
    const auto set = set_priority(hub_thread, config.daemon);
    return set ? set : refused_by_system(set.error());
  }

  Result<void> listen_control() {
    auto listener = listen_unix(config.control.socket);
    ABBE_TRY(listener);
    control_listener = std::move(*listener);
    // So that the first requests find the groups of a name service that answers in time.
    const std::array groups{config.control.look_group, config.control.change_group,
                            config.control.move_group};
    account_names().look_up(groups, kNameServiceTimeout);
    return {};
  }

  Result<void> run() {
    calibration.emplace(config, *authority, recorder.get(), clock);
    std::optional<Counting> left;
    if (left_counting.state) {
      recorder->attach(to_attachment(*left_counting.state), time.now());
      left = left_counting.state->counting;
    }

    auto left_sensors = sensors_left();
    if (left_sensors) recorder->attach(*left_sensors, time.now());
    reference.emplace(config, recorder.get(), std::move(left));
    sensors.emplace(recorder.get());
    verification.emplace(config);
    touching.emplace(*devices, devices->moves());
    tracker.emplace(*devices, devices->longest_tracker_order());
    store_changes.emplace(config.daemon.models_dir());
    hub.emplace(HubParts{.config = config,
                         .time = time,
                         .devices = *devices,
                         .authority = *authority,
                         .calibration = *calibration,
                         .publisher = publisher ? &*publisher : nullptr,
                         .recorder = recorder.get(),
                         .reference = &*reference,
                         .touching = &*touching,
                         .verification = &*verification,
                         .tracker = &*tracker,
                         .store_changes = &*store_changes,
                         .network_user = network_user,
                         .identity = &*machine_identity,
                         .sensors = &*sensors,
                         .sensor_state = std::move(left_sensors)});
    running_since = WallTime::clock::now();
    hub_may_run.set_value();

    closing_left =
        run_abandonable([dir = config.recording.dir, running = recording, stop = stop_closing] {
          return close_left_recordings(dir, running, *stop);
        });

    control = serve_control(std::move(control_listener), config.control.socket,
                            [this](const nlohmann::json& request, const ControlPeer& peer) {
                              return answer_request(*hub, request, peer);
                            });

    journal.emplace(config.machine.name, open_journal(), [this] { return observe(); });
    if (counted_axes(config)) {
      counting_state.emplace(
          counting_state_file(config.daemon.data_dir),
          [this, set_up = counting_set_up(config)] { return look_at_counting(set_up); },
          [](const std::string& fault) { fmt::print(stderr, "abbed: {}\n", fault); });
    }

    return {};
  }

  [[nodiscard]] SensorStateClock sensor_clock() const {
    return {.host = time.now(), .utc = utc_now().time_since_epoch(), .speed = config.daemon.speed};
  }

  /// The state of the sensors in the earlier run; nullopt: they start without one.
  std::optional<RecordingAttachment> sensors_left() {
    const auto checked = sensor_check_options(config);
    const auto file = sensor_state_file(config.daemon.data_dir);
    std::error_code failed;
    remove_half_written(file);
    if (checked.sensors.empty()) return std::nullopt;
    if (!std::filesystem::exists(file, failed) && !failed) return std::nullopt;
    const auto text = read_regular_file(file);
    auto state = text ? left_sensor_state(*text, checked, sensor_clock())
                      : Result<RecordingAttachment>{tl::unexpected(text.error())};
    if (state) return std::move(*state);
    warnings.push_back(fmt::format("{}: {}: doubts about sensors before the start are not known",
                                   file.string(), state.error().text));
    return std::nullopt;
  }

  /// Writes the state of the sensors every kSensorsWritten.
  void follow_sensors(WallTime now) {
    if (writing_sensors.valid()) {
      if (writing_sensors.wait_for(0s) != std::future_status::ready) return;
      const auto written = outcome_of(writing_sensors);
      const std::string seen = written ? "" : written.error().text;
      if (std::exchange(sensors_fault, seen) != seen && !seen.empty())
        fmt::print(stderr, "abbed: {}: after a restart doubts about sensors would not be known\n",
                   seen);
    }
    if (now < next_sensors) return;
    next_sensors = now + kSensorsWritten;
    const auto checks = hub->call([this] { return hub->live().sensors(); }, kSensorsTimeout);
    if (!checks || checks->empty()) return;
    writing_sensors =
        run_abandonable([file = sensor_state_file(config.daemon.data_dir),
                         text = sensor_state_text(*checks, sensor_clock())]() -> Result<void> {
          ABBE_TRY(create_folder(file.parent_path()));
          return replace_file(file, text);
        });
  }

  /// Counter state for a later run; nullopt if the card has no serial number that identifies it.
  /// Any thread except the hub's.
  std::optional<CountingState> look_at_counting(const std::string& set_up) {
    if (boot.empty()) return std::nullopt;
    const auto look = [this] { return std::pair{reference->counting(), reference->carried_on()}; };

    // acquire: pairs with the release in end_hub(); after it only this thread uses `reference`
    auto seen = hub_has_ended.load(std::memory_order_acquire) ? std::optional{look()}
                                                              : hub->call(look, kHubTimeout);
    if (!seen || !seen->first || seen->first->progress.serial_number().empty()) return std::nullopt;

    if (left_counting.state) {
      left_counting.state.reset();
      if (!seen->second.empty())
        fmt::print(stderr, "abbed: the counter card counted on: {} stay referenced\n",
                   fmt::join(seen->second, ", "));
    }

    return CountingState{.boot_id = boot, .set_up = set_up, .counting = std::move(*seen->first)};
  }

  /// The state that the journal follows. Any thread except the hub's.
  Observed observe() {
    auto seen = hub->call(
        [this] {
          const ActiveModelState active = hub->model_state();
          return Observed{.streams = hub->health(),
                          .session = calibration->status(),
                          .model = {.state = std::string{status_name(active.status)},
                                    .id = active.model != nullptr ? active.model->id : "",
                                    .reason = active.reason},
                          .stop = observed_stop(devices->machine_stop())};
        },
        kHubTimeout);
    Observed now = seen ? std::move(*seen) : Observed{.hub_answers = false};
    const std::lock_guard lock{participant_mutex};
    now.participant = participant;

    return now;
  }

  /// Reports and records each change of the wall clock once: the dates of the recording are those
  /// of the start.
  void follow_clock() {
    const ClockChange change = clock.since_start();
    const auto further = [](auto a, auto b) {
      return std::chrono::abs(a - b) >= kLeastClockChange;
    };
    if (!further(change.step, clock_change.step) &&
        !further(change.suspended, clock_change.suspended))
      return;
    const auto attached = hub->call(
        [this, attachment = to_attachment(change)]() mutable {
          recorder->attach(std::move(attachment), time.now());
          return true;
        },
        kHubTimeout);
    if (!attached) return;  // again in the next cycle
    clock_change = change;
    for (const std::string& text : in_words(change, "abbed started"))
      fmt::print(stderr, "abbed: {}\n", text);
  }

  void supervise(WallTime now) {
    if (!supervisor) return;
    supervisor->poll(now);
    const std::lock_guard lock{participant_mutex};
    const auto& end = supervisor->last_end();
    participant = {.restarts = supervisor->restarts(),
                   .last_end = end ? end->text() : std::string{},
                   .start_fault = supervisor->start_fault()};
  }

  void tidy_recordings(WallTime now) {
    if (config.recording.keep <= 0h) return;
    if (tidying.valid() && tidying.wait_for(0s) == std::future_status::ready) {
      const auto removed = outcome_of(tidying);
      if (!removed) fmt::print(stderr, "abbed: {}\n", removed.error().text);
      if (removed && !removed->empty())
        fmt::print(stderr, "abbed: removed {} recordings older than {} h\n", removed->size(),
                   config.recording.keep.count());
    }

    if (clock_steps.look(clock.read()) && std::exchange(tidies, false))
      fmt::print(stderr,
                 "abbed: the clock was set: no old recordings are removed until the next start\n");
    if (!tidies || tidying.valid() || now < next_tidying) return;
    next_tidying = now + kTidyPeriod;

    tidying = run_abandonable([dir = config.recording.dir, models = config.daemon.models_dir(),
                               rule = KeepRule{.now = std::filesystem::file_time_type::clock::now(),
                                               .keep = config.recording.keep,
                                               .running = recording,
                                               .lasted = now - running_since}] {
      return remove_old_recordings(dir, models, rule);
    });
  }

  void report_left_recordings() {
    if (!closing_left.valid() || closing_left.wait_for(0s) != std::future_status::ready) return;
    const auto closed = outcome_of(closing_left);
    if (!closed) return fmt::print(stderr, "abbed: {}\n", closed.error().text);
    for (const auto& left : *closed) {
      if (!left.fault.empty())
        fmt::print(stderr, "abbed: recording of a killed abbed is left unchanged: {}\n",
                   left.fault);
      else
        fmt::print(stderr, "abbed: {} {}, left open by a killed abbed\n",
                   left.messages > 0 ? fmt::format("closed, with {} messages,", left.messages)
                                     : std::string{"removed, without messages,"},
                   left.file.string());
    }
  }

  void run_hub(std::future<void>& may_run) noexcept {
    (void)::pthread_setname_np(::pthread_self(), "abbe-hub");
    drivers::prepare_heap_of_this_thread();
    try {
      may_run.get();
    } catch (const std::future_error&) {
      return;
    }
    try {
      hub->run();
    } catch (const std::exception& error) {  // alive() then returns false
      (void)devices->stop_machine();  // without the hub nothing notices that its operator is gone
      fmt::print(stderr, "abbed: the hub ended with an internal error: {}\n", error.what());
    }
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
  // The recorder is the last step that can fail: repeated failed starts then leave no files.
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
  state_->supervise(now);
  state_->follow_clock();
  state_->follow_sensors(now);
  state_->tidy_recordings(now);
  state_->store_upkeep.cycle(now);
  state_->report_left_recordings();
}

std::optional<drivers::IppStop> Abbed::end() {
  return state_->end();
}

void Abbed::stop_machine() {
  (void)state_->devices->stop_machine();
}

bool Abbed::alive() const {
  return WallTime::clock::now() - std::max(state_->hub->last_cycle(), state_->running_since) <
         kHubTimeout;
}

std::vector<std::string> Abbed::warnings() const {
  return state_->warnings;
}

}  // namespace abbe::daemon
