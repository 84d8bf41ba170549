#pragma once
/// A laser tracker controller with the emScon TPI protocol, without its socket: bytes and a time
/// in, bytes out. It has the preconditions of a real controller (warm-up, Initialize, a reflector,
/// a measurement mode) and refuses commands with the same status. Not thread-safe.
///
/// Our choices where no public source describes the behaviour:
///   - A broken beam: an error packet with status Unknown for StartMeasurement, then event
///     NotReady. When the beam is back: event Ready; points continue by themselves if
///     keepLastPosition is set.
///   - GoBirdBath and FindReflector that find no reflector: NoDistanceSet.

#include <array>
#include <cstddef>
#include <cstdint>
#include <map>
#include <optional>
#include <span>
#include <vector>

#include "abbe/protocol/emscon/framer.hpp"
#include "abbe/protocol/emscon/requests.hpp"
#include "abbe/protocol/emscon/results.hpp"
#include "abbe/sim/fault.hpp"
#include "abbe/sim/tracker_model.hpp"

namespace abbe::sim {

namespace emscon = protocol::emscon;

struct TrackerOptions {
  TrackerModel model;
  /// Time from a point to the earliest burst that contains it.
  std::chrono::nanoseconds delay = std::chrono::milliseconds{1};
  std::chrono::nanoseconds warm_up{};  ///< time from power-on until the laser is stable
  std::chrono::nanoseconds command_latency = std::chrono::milliseconds{10};
  std::chrono::nanoseconds initialize_time = std::chrono::seconds{2};
  /// Initialize moves the beam off the reflector; after this time the operator has brought the
  /// reflector back into the beam. 0: the reflector is in the bird bath, where the beam goes.
  std::chrono::nanoseconds fetch_beam{};
  double air_temperature_C = 20.0;
  double air_pressure_mbar = 1013.25;
  double air_humidity_percent = 50.0;
  double air_drift_K_per_hour = 0.5;
};

class TrackerDevice {
 public:
  /// The controller is switched on at `now`. `machine` must outlive it.
  TrackerDevice(const TrackerOptions& options, const VirtualMachine& machine, HostTime now);

  void connected(HostTime now);
  void disconnected();
  void receive(std::span<const std::byte> bytes, HostTime now);
  /// Executes everything that is due until `now`, in order of time.
  void advance(HostTime now);
  [[nodiscard]] HostTime next_due() const;

  /// Bytes for the client that were made since the last call.
  [[nodiscard]] std::vector<std::byte> take_output();
  /// True if the connection must be closed after the output has been sent.
  [[nodiscard]] bool wants_close() const { return wants_close_; }
  /// False while the controller restarts: new connections are then closed at once.
  [[nodiscard]] bool accepts() const { return !booting_until_; }

  void inject(const Fault& fault, HostTime now);

  /// Time at which the first point of the first continuous measurement was taken.
  [[nodiscard]] std::optional<HostTime> first_stream() const { return first_stream_; }
  [[nodiscard]] bool streaming() const { return stream_.has_value(); }
  [[nodiscard]] std::uint64_t points_sent() const { return points_sent_; }
  [[nodiscard]] std::uint64_t initializations() const { return initializations_; }
  /// Number of GoBirdBath, FindReflector and GoPosition commands executed.
  [[nodiscard]] std::uint64_t beam_moves() const { return beam_moves_; }

 private:
  struct Command {
    emscon::Request request;
    HostTime due;
  };
  struct Stream {
    DeviceTime next_point;
    std::chrono::nanoseconds separation;
    HostTime next_burst;
    std::uint64_t points_left;
  };

  // Commands.
  void on_packet(std::span<const std::byte> packet, HostTime now);
  void carry_out(const emscon::Request& request, HostTime at);
  [[nodiscard]] emscon::Status outcome(const emscon::Request& request, HostTime at);
  [[nodiscard]] emscon::Status start_measurement(HostTime at);
  [[nodiscard]] emscon::Status set_mode(emscon::MeasurementMode mode);
  bool answer_query(const emscon::Request& request, HostTime at);
  bool answer_setting(const emscon::Request& request);
  void initialise(HostTime at);
  [[nodiscard]] emscon::Status move_beam(HostTime at);
  [[nodiscard]] std::chrono::nanoseconds latency(const emscon::Request& request) const;

  // Actions without a command.
  void step(HostTime at);
  void emit_burst(HostTime at);
  void emit_points(std::span<const emscon::MultiPoint> points);
  void emit_single(HostTime at);
  void check_weather(HostTime at);
  void finish_boot(HostTime at);
  void return_beam();
  [[nodiscard]] std::optional<emscon::MultiPoint> point_at(DeviceTime t);
  [[nodiscard]] emscon::PointStatus status_of(BeamSpeed speed, HostTime at) const;
  [[nodiscard]] emscon::Environment environment(HostTime at) const;
  [[nodiscard]] double air_temperature_C(HostTime at) const;

  template <class... Packet>
  void send(const Packet&... packet) {
    if (!connected_) return;
    const std::size_t size = emscon::encode(packet..., std::span(packet_));
    out_.insert(out_.end(), packet_.begin(), packet_.begin() + static_cast<std::ptrdiff_t>(size));
  }
  void send_event(emscon::Event event);
  void reset_session();

  TrackerOptions options_;
  const VirtualMachine& machine_;
  emscon::PacketFramer framer_;
  /// the packet being written
  std::vector<std::byte> packet_ = std::vector<std::byte>(emscon::kMaxPacketSize);
  std::vector<std::byte> out_;
  bool connected_ = false;
  bool wants_close_ = false;
  bool announce_start_ = false;

  HostTime power_on_;
  HostTime warm_at_;
  bool warm_announced_ = true;
  std::optional<HostTime> booting_until_;
  bool initialised_ = false;
  bool distance_set_ = true;
  std::uint64_t initializations_ = 0;
  std::uint64_t beam_moves_ = 0;

  std::optional<Command> pending_;
  emscon::Units units_;
  emscon::SystemSettings settings_;
  emscon::Environment set_environment_;
  emscon::Refraction refraction_;
  emscon::SetContinuousTimeModeParams continuous_;
  emscon::SetStationaryModeParams stationary_;
  emscon::SetStatisticMode statistics_;
  emscon::SetTransformation transformation_;
  emscon::SetStationOrientation orientation_;
  emscon::SetSearchParams search_;
  emscon::CoordinateSystem coordinates_ = emscon::CoordinateSystem::RightHanded;
  std::map<emscon::LongParameter, std::int32_t> long_parameters_;
  emscon::MeasurementMode mode_ = emscon::MeasurementMode::Stationary;
  std::int32_t reflector_ = 0;

  std::optional<Stream> stream_;
  std::optional<HostTime> single_due_;
  std::optional<HostTime> first_stream_;
  struct Grid {
    DeviceTime first;
    std::chrono::nanoseconds separation;
  };
  /// measurement times of the points since power-on: a second start does not shift them
  std::optional<Grid> grid_;
  std::uint64_t bursts_ = 0;
  std::uint64_t noise_base_ = 0;
  std::uint64_t noise_next_ = 0;
  std::uint64_t points_sent_ = 0;

  double announced_temperature_C_;
  double weather_step_K_ = 0.0;
  std::optional<HostTime> beam_back_;
  MeasuringTime beam_broken_;
  MeasuringTime speed_fault_;
  MeasuringTime prism_fault_;
  MeasuringTime reflector_away_;
  HostTime mute_until_ = HostTime::min();
  HostTime busy_until_ = HostTime::min();
  std::optional<HostTime> stall_until_;
};

}  // namespace abbe::sim
