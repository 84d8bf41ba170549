#pragma once
/// The one configuration file, read once into plain structs. In the file lengths are mm, small
/// errors um and urad, times ms or us, and the unit stands in the key; here everything is SI or
/// std::chrono. A relative path is meant from the folder of the file. `machine.toml` (only
/// [machine], [axes], [target], [model] and the noise figures of [tracker]) and `abbed.toml`
/// (everything) are the same format: each reader takes from either file what it needs. Pure data;
/// safe to copy between threads.

#include <array>
#include <chrono>
#include <cstdint>
#include <filesystem>
#include <map>
#include <optional>
#include <string>
#include <string_view>
#include <vector>

#include "abbe/base/error.hpp"
#include "abbe/calib/environment/refractive_index.hpp"
#include "abbe/drivers/counter_card/wiring.hpp"
#include "abbe/drivers/environment/modbus_line.hpp"
#include "abbe/drivers/environment/register_map.hpp"
#include "abbe/drivers/sampling/distance_code.hpp"
#include "abbe/drivers/sampling/probe_options.hpp"

namespace abbe::daemon {

enum class AxisKind { Linear, Rotary };

/// [axes.NAME]. `reference` is where positioning and angle tables are zero: 0 if inside the range,
/// else the minimum.
struct AxisConfig {
  std::string name;
  AxisKind kind = AxisKind::Linear;
  double min = 0.0;        ///< m or rad
  double max = 0.0;        ///< m or rad
  double reference = 0.0;  ///< m or rad
  friend bool operator==(const AxisConfig&, const AxisConfig&) = default;
};

enum class BasisConfig { Linear };

/// Direction of a machine axis along which the vertical axis of a levelled tracker points.
enum class TrackerVertical { PlusX, MinusX, PlusY, MinusY, PlusZ, MinusZ };

/// [machine], [axes.*], [target], [model], and the noise figures of [tracker]: what identification
/// needs to know.
struct MachineConfig {
  std::string name;
  std::string chain;             ///< ISO 10791-6 style, "[w X' b Y Z (C1) t]"
  std::vector<AxisConfig> axes;  ///< X, Y, Z, then further linear ones, then rotary ones by name
  std::array<double, 3>
      target_offset_m{};  ///< reflector centre relative to the tool reference point, machine axes
  /// [target] offset_mm is there; else the zeros above are no offset: require_target()
  bool target_given = false;
  BasisConfig basis = BasisConfig::Linear;
  std::map<std::string, std::vector<double>>
      nodes_m;                  ///< of every linear axis, ascending, both ends of travel included
  double sigma_range_m = 2e-6;  ///< standard deviation of one tracker range
  double sigma_angle_rad =
      3e-6;  ///< standard deviation of one tracker direction, perpendicular to the beam
  /// Of the offset all ranges have in common. 10 um as limit of error of home position and
  /// reflector: 10 um / sqrt(3).
  double u_range_offset_m = 6e-6;
  std::optional<TrackerVertical> tracker_vertical;          ///< none: the tracker is not levelled
  std::optional<std::array<double, 3>> tracker_position_m;  ///< machine coordinates, to 0.5 m
  [[nodiscard]] const AxisConfig* find_axis(std::string_view name) const noexcept;
  friend bool operator==(const MachineConfig&, const MachineConfig&) = default;
};

enum class WeatherConfig {
  None,
  Read,
  Compute
};  ///< none: environment is not read; compute: the controller corrects n

/// Continuous: for runs on the fly. Stationary: one mean after the other, for verification at
/// standstills; no run on the fly is possible then.
enum class TrackerModeConfig { Continuous, Stationary };

/// emScon sets both together.
struct TrackerSearchConfig {
  double radius_m = 0.0;
  std::chrono::nanoseconds timeout{};  ///< whole ms
};

/// [tracker]: the instrument on the wire.
struct TrackerConfig {
  std::string name = "tracker";
  std::string host;
  std::uint16_t port = 700;
  TrackerModeConfig mode = TrackerModeConfig::Continuous;
  double point_rate_hz = 500.0;                                              ///< continuous
  std::chrono::nanoseconds stationary_time{std::chrono::milliseconds{500}};  ///< a mean's; whole ms
  WeatherConfig weather = WeatherConfig::Compute;
  /// Relative standard uncertainty that all its distances have in common. Unless given: with
  /// "compute" what the controller's own sensors leave of the air (0.2 K and 30 Pa: 2e-7); with
  /// [air] assumed_index 0, that of [air] is added; else nobody corrects for measured air:
  /// u_of_unmeasured_air().
  double u_scale = kControllersAir;
  static constexpr double kControllersAir = 0.2 / 1e6;
  std::chrono::nanoseconds max_constant_delay{
      std::chrono::milliseconds{2}};  ///< bound of the unobservable part of the delay
  std::chrono::nanoseconds connect_timeout{std::chrono::seconds{3}};
  std::chrono::nanoseconds command_timeout{std::chrono::seconds{3}};
  std::chrono::nanoseconds initialize_timeout{std::chrono::seconds{120}};
  std::chrono::nanoseconds silence_timeout{
      std::chrono::milliseconds{1500}};  ///< no data while streaming: a fault
  std::string reflector;  ///< name or id in the controller's list; empty: the one that is set
  bool home_after_initialize = false;  ///< the beam to the bird bath after Initialize
  std::optional<TrackerSearchConfig>
      search;  ///< around where the beam points; none: as set in the controller
};

enum class EncoderTransport { Udp, SocketCan };
/// Who sends the SYNC: the device thread, CAN_BCM on its timer, or the machine (then abbed sends
/// nothing at all).
enum class SyncConfig { Daemon, Kernel, External };

/// One element of [encoder] nodes. reading = offset + count * step, the step negative when
/// `invert = true`.
struct EncoderNodeConfig {
  std::string axis;
  std::uint8_t node = 0;  ///< CANopen node id, 1 to 127
  double step = 1e-9;     ///< m or rad per count, signed
  double offset = 0.0;    ///< m or rad: the reading at count 0
  AxisKind kind = AxisKind::Linear;
  int tpdo = 1;           ///< 1 or 2: which one carries the position
  int position_byte = 0;  ///< where in it; External only, else the node is asked
  /// rotary: counts after which it begins anew; 0: the node is asked
  std::int64_t wrap_counts = 0;
};

/// [encoder]: CANopen encoders on one bus.
struct EncoderConfig {
  std::string name = "encoder";
  EncoderTransport transport = EncoderTransport::SocketCan;
  std::string interface;         ///< SocketCAN only, "can0"
  std::uint16_t local_port = 0;  ///< UDP only; 0: the kernel chooses
  std::string peer_host;         ///< UDP only
  std::uint16_t peer_port = 0;   ///< UDP only
  SyncConfig sync = SyncConfig::Daemon;
  std::chrono::nanoseconds sync_period{std::chrono::milliseconds{1}};
  std::chrono::nanoseconds
      sampling_delay{};  ///< from the SYNC (its echo; UDP: its send) to the node's latch
  std::chrono::nanoseconds u_sampling_delay =
      std::chrono::microseconds{50};  ///< its standard uncertainty; 0 only with simulated devices
  /// True: the control already corrects these readings. No model is ACTIVE then, and none can be
  /// identified: it would be applied, or measured, on top of the control's own.
  bool axes_compensated = false;
  std::vector<EncoderNodeConfig>
      nodes;  ///< in the order of MachineConfig::axes; X, Y and Z are there
};

enum class CardTransport { Usb, Usbip };

/// [counter_card]: a USB-QUAD08 whose counters are the axes, instead of [encoder].
/// reading = offset + count * step, count 0 being where the axis stood when the card was set up.
/// `step_nm` is that of one count, four counts a signal period.
struct CounterCardConfig {
  std::string name = "counter_card";
  CardTransport transport = CardTransport::Usb;
  std::string host = "127.0.0.1";  ///< USB/IP only
  std::uint16_t port = 3240;       ///< USB/IP only
  std::string bus_id = "1-1";      ///< USB/IP only
  std::string serial_number;       ///< empty: the only card there is
  drivers::CounterCardWiring wiring;
  std::uint32_t sample_every = 1;  ///< one axis sample for so many scans
  std::chrono::nanoseconds max_constant_delay{
      std::chrono::milliseconds{1}};  ///< bound of the unobservable part of the delay
  bool axes_compensated = false;      ///< true: the control already corrects these readings
  /// Axes without marks read their offset where they stand when the card is set up for the first
  /// time. Else, and always when it began anew in the middle, they are not known until
  /// `abbe reference --here`.
  bool zero_is_here = false;
};

/// One element of [reference] axes: the distance-coded marks of the scale. Reading at a
/// mark = zero_mark + (reversed: -) its place on the scale.
struct ReferenceAxisConfig {
  std::string axis;
  drivers::DistanceCode code;
  double signal_period = 20e-6;  ///< of the scale, m or rad
  double zero_mark = 0.0;        ///< m or rad: the reading at the scale's zero mark
  bool reversed = false;         ///< the scale's places rise as the reading falls
};

/// [reference]: a second card that latches axes of [counter_card] on their marks. These axes are
/// not known until `abbe reference` has found where their counters began.
struct ReferenceConfig {
  CounterCardConfig card;                 ///< its axes are in the order of `axes`
  std::vector<ReferenceAxisConfig> axes;  ///< each is an axis of [counter_card]
  std::chrono::nanoseconds u_alignment{std::chrono::milliseconds{
      1}};                    ///< how well the two cards' scans lie beside each other in time
  double tolerance_m = 1e-6;  ///< how well the two cards' counts must be brought together, m or rad
};

/// One [[environment]]: a Modbus device that measures air, scales or parts.
struct EnvironmentConfig {
  std::string name;
  drivers::ModbusAddress address;
  drivers::RegisterMap map;
  std::chrono::nanoseconds period{std::chrono::seconds{1}};
  std::chrono::nanoseconds answer_timeout{std::chrono::milliseconds{500}};
};

/// One [[thermal]]: the readings of an axis are corrected to what the machine really does, by the
/// temperature of its scale.
struct ThermalConfig {
  std::string axis;
  std::uint8_t temperature = 0;  ///< index into Config::temperatures
  double alpha_per_K = 0.0;      ///< of the scale
  double u_alpha_per_K = 0.0;
  double u_temperature_K = 0.0;
  double fixed_m = 0.0;  ///< the reading where the scale is fixed to the machine
};

/// [air]: the refractive index of the air that is measured.
struct AirConfig {
  calib::IndexEquation equation = calib::IndexEquation::Ciddor;
  double wavelength_m = calib::kHeliumNeon_m;
  double co2_ppm = 450.0;
  double u_temperature_K = 0.2;
  double u_pressure_Pa = 30.0;
  double u_relative_humidity = 0.03;
  /// people and burners add 50 to 1000 ppm to the 430 outside; nobody measures it
  double u_co2_ppm = 200.0;
  std::chrono::nanoseconds max_age{
      std::chrono::seconds{60}};  ///< an older value is not available any more
  /// The tracker's distances are raw: computed with this index. Then they are corrected to the air
  /// measured.
  std::optional<double> assumed_index;
};

/// [probe]: the touch probe on the latch and edge channels of [counter_card]. Delay and jitter are
/// those that `abbe calibrate probe` finds for this probe; the wiring comes from the card.
struct ProbeConfig {
  std::string name = "probe";
  drivers::ProbeDelay delay;
  drivers::ProbeApproach approach;
  drivers::ProbeSwitching switching;
  std::chrono::nanoseconds window_before{std::chrono::milliseconds{10}};
  std::chrono::nanoseconds window_after{std::chrono::milliseconds{10}};
};

/// [cmm]: a measuring machine behind an I++ DME server. Its touches are the daemon's; its positions
/// are the axes where no other device gives them.
struct CmmConfig {
  std::string name = "cmm";
  std::string host;
  std::uint16_t port = 1294;
  std::string tool;            ///< set before measuring; empty: the one that is set
  bool home = false;           ///< may send the machine home if it is not
  std::uint32_t probe = 1;     ///< number of its probe in the touches
  double u_position_m = 1e-6;  ///< of a reported position
  /// A measuring machine reports positions it has corrected itself, unless told otherwise.
  bool axes_compensated = true;
  std::chrono::nanoseconds command_timeout{std::chrono::seconds{3}};
  std::chrono::nanoseconds motion_timeout{std::chrono::seconds{120}};
};

enum class RealTimeMode { Enforce, Ignore };

/// [daemon]
struct DaemonConfig {
  std::filesystem::path data_dir = "/var/lib/abbe";
  [[nodiscard]] std::filesystem::path models_dir() const { return data_dir / "models"; }
  std::filesystem::path runtime_dir = "/run/abbe";
  std::chrono::nanoseconds hub_period{std::chrono::microseconds{250}};
  std::chrono::nanoseconds watermark{
      std::chrono::milliseconds{600}};  ///< how long the hub waits for a late stream
  bool simulated = false;  ///< the devices are simulated: only then may `speed` differ from 1
  double speed = 1.0;      ///< host time = speed x CLOCK_MONOTONIC
  RealTimeMode realtime = RealTimeMode::Ignore;
  int tracker_priority = 40;  ///< SCHED_FIFO, 1 to 99
  int encoder_priority = 50;
  int hub_priority = 30;
  std::optional<int> tracker_cpu;  ///< the core the thread is bound to
  std::optional<int> encoder_cpu;
  std::optional<int> hub_cpu;
  std::optional<std::chrono::microseconds>
      cpu_latency;  ///< bound on a processor's waking; none: not asked for
};

/// [recording]
struct RecordingConfig {
  std::filesystem::path dir;  ///< default: data_dir/recordings
  std::uint32_t chunk_bytes = 256 * 1024;
  std::chrono::nanoseconds chunk_period{
      std::chrono::seconds{1}};  ///< a chunk is closed at the latest after this
  bool raw = true;               ///< also record the device bytes
  /// recording stops, acquisition goes on, below this
  std::uint64_t min_free_bytes = 256ull * 1024 * 1024;
  std::uint64_t max_file_bytes = 4096ull * 1024 * 1024;  ///< then the next part begins; 0: never
  std::chrono::hours keep{0};  ///< recordings no model names are removed after this; 0: never
};

enum class Supervise { Child, Systemd, Off };

/// [dds]
struct DdsConfig {
  std::uint32_t domain = 0;
  double snapshot_hz = 50.0;       ///< at most; 0: whenever something new came
  double compensation_hz = 100.0;  ///< at most; 0: whenever something new came
  std::chrono::nanoseconds validity{
      std::chrono::milliseconds{500}};  ///< a subscriber must not apply older vectors
  Supervise supervise = Supervise::Child;
  int priority = 20;  ///< SCHED_FIFO of abbe-dds, below hub and devices; 0: an ordinary process
  std::filesystem::path profile;  ///< XML profiles; empty: the built-in ones
  std::filesystem::path
      security;  ///< keys as `abbe dds keys` makes them; empty: none, what the profile says
  std::filesystem::path socket;  ///< default: runtime_dir/dds.sock
};

/// [gate]: what a model must satisfy before it may become active.
struct GateConfig {
  double max_error_m = 1e-3;   ///< largest |V| inside the validity volume
  double max_gradient = 5e-3;  ///< largest |dV/dq|, m per m; 250 um between nodes 50 mm apart
  /// By which the scales may read something else at a vertex of an on-the-fly path, beside their
  /// uncertainty.
  double path_tolerance_m = 20e-6;
  /// Share of the legs of an on-the-fly run that a fit does not see while it is judged by them.
  /// Models of a ball array are judged by positions held out, one after the other.
  double holdout_fraction = 0.2;
  /// What this shop takes as it is, by name: "evemu-shape-only", a ball array's model whose
  /// rotation about Ball1 nobody has referenced; "smaller-volume", a model in place of one that
  /// holds in more of the machine; "scale-change", one whose scale is another; "path-orientation",
  /// a path file that may be turned (calib/otf/orientation).
  std::vector<std::string> accept;

  [[nodiscard]] bool accepts(std::string_view name) const;
};

/// [evemu] artefact_sensor or artefact_C: how warm the ball array is while it is touched.
struct ArtefactTemperatureConfig {
  std::optional<std::uint8_t> sensor;  ///< index into Config::temperatures
  double fixed_K = 293.15;             ///< without a sensor
  double u_temperature_K = 0.0;        ///< standard: of the sensor, and of the array against it
};

/// [evemu]: calibration with a ball array.
struct EvemuConfig {
  std::string estimator = "bayes-pose";  ///< one of calib::evemu::estimator()
  std::string folds = "position";        ///< one of calib::evemu::folds_by(): for lasso, mcp, scad
  int order = 3;                         ///< of the polynomials
  std::vector<int> positions{4, 8, 3, 7,
                             2, 6, 1, 5};  ///< of the array, in the order they are touched
  std::size_t points_per_ball = 25;
  std::size_t points_per_block = 25;
  std::chrono::nanoseconds longest_pause{
      std::chrono::hours{1}};                         ///< without a touch: the session ends
  std::optional<ArtefactTemperatureConfig> artefact;  ///< none: the array counts as at 20 C
};

/// [control]. Root and the daemon's own user may ask for everything; see control_roles.hpp.
struct ControlConfig {
  std::filesystem::path socket;              ///< default: runtime_dir/control.sock
  std::string look_group;                    ///< empty: everybody who may open the socket
  std::string change_group = "abbe-change";  ///< may change what is in force; empty: nobody else
  std::string move_group = "abbe-move";      ///< may move a machine; empty: nobody else
};

/// The whole file. `[tracker]` without host, a missing `[encoder]`, a missing `[counter_card]` mean
/// "not connected". The axes come from one device: [encoder] or [counter_card].
struct Config {
  MachineConfig machine;
  std::optional<TrackerConfig> tracker;
  std::optional<EncoderConfig> encoder;
  std::optional<CounterCardConfig> counter_card;
  std::vector<EnvironmentConfig> environment;
  std::vector<std::string>
      temperatures;  ///< names of EnvironmentSample::temperature_K, as they are configured
  std::vector<ThermalConfig> thermal;
  AirConfig air;
  std::optional<ReferenceConfig> reference;
  std::optional<ProbeConfig> probe;
  std::optional<CmmConfig> cmm;
  DaemonConfig daemon;
  RecordingConfig recording;
  DdsConfig dds;
  GateConfig gate;
  EvemuConfig evemu;
  ControlConfig control;

  /// What a sample of [encoder] or [counter_card] holds, in its order; empty: there is none.
  [[nodiscard]] std::vector<std::string> connected_axes() const;

  /// The control already corrects what the axes read, whichever device reads them.
  [[nodiscard]] bool axes_compensated() const noexcept {
    return (encoder && encoder->axes_compensated) ||
           (counter_card && counter_card->axes_compensated) ||
           (cmm_reads_axes() && cmm->axes_compensated);
  }
  /// No other device reads the axes: they are what the measuring machine reports.
  [[nodiscard]] bool cmm_reads_axes() const noexcept { return cmm && !encoder && !counter_card; }
};

/// Reads and checks a whole file. Io if it cannot be read; else BadInput with one line per fault in
/// Error::details, at most 20, each "file:line:column: key: what is wrong". Nothing is used of a
/// file that has a fault.
[[nodiscard]] Result<Config> load_config(const std::filesystem::path& file);

/// The same for the text of a file; `file` names it in the errors and anchors relative paths.
[[nodiscard]] Result<Config> parse_config(std::string_view text, const std::filesystem::path& file);

/// SHA-256 in hex over what a model depends on: the machine (identity, chain, axes, target, basis,
/// nodes) and what a scale reading is (which node is which axis, its step and offset, whether the
/// control corrects it already). A stored model is ACTIVE only where this agrees. Noise figures,
/// and how the bytes travel, do not enter.
[[nodiscard]] std::string machine_hash(const Config& config);

}  // namespace abbe::daemon
