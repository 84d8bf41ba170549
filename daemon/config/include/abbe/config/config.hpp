#pragma once
/// The configuration file, read once into plain structs. In the file lengths are in mm, small
/// errors in um and urad, times in ms or us, and the key contains the unit; in the structs all
/// values are SI or std::chrono. A relative path is relative to the folder of the file.
/// `machine.toml` (only [machine], [axes], [target], [model] and the noise of the tracker) and
/// `abbed.toml` (everything) have the same format: a reader uses the tables that it needs from
/// either file. Pure data; safe to copy between threads.

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
#include "abbe/config/device_configs.hpp"
#include "abbe/config/meaning.hpp"
#include "abbe/drivers/axis_kind.hpp"
#include "abbe/drivers/real_time_mode.hpp"
#include "abbe/settings/dds_config.hpp"

namespace abbe::daemon {

using drivers::AxisKind;

/// [axes.NAME]. The tables of positioning and angular errors are zero at the axis position
/// `reference`. Default of `reference`: 0 if 0 is within the range, else the minimum.
struct AxisConfig {
  std::string name;
  AxisKind kind = AxisKind::Linear;
  double min = 0.0;        ///< m or rad
  double max = 0.0;        ///< m or rad
  double reference = 0.0;  ///< m or rad
  friend bool operator==(const AxisConfig&, const AxisConfig&) = default;
};

/// Direction of a machine axis along which the vertical axis of a levelled tracker points.
enum class TrackerVertical { PlusX, MinusX, PlusY, MinusY, PlusZ, MinusZ };

/// Interpolation of the error tables between their nodes.
enum class TableInterpolation { Linear, NaturalCubic, NotAKnotCubic };

/// [machine], [axes.*], [target], [model], and the noise of the tracker: the input of an
/// identification.
struct MachineConfig {
  std::string name;
  std::string chain;             ///< ISO 10791-6 style, "[w X' b Y Z (C1) t]"
  std::vector<AxisConfig> axes;  ///< X, Y, Z, then other linear, then rotary axes by name
  /// Reflector centre relative to the tool reference point, along the machine axes.
  std::array<double, 3> target_offset_m{};
  /// True if the file contains [target] offset_mm. If false, target_offset_m is not valid; see
  /// require_target().
  bool target_given = false;
  /// Nodes of every linear axis, ascending, from one end of travel to the other.
  std::map<std::string, std::vector<double>> nodes_m;
  /// Key [model] basis: interpolation of the tables that on-the-fly calibration identifies.
  TableInterpolation interpolation = TableInterpolation::Linear;
  double sigma_range_m = 2e-6;  ///< standard deviation of one tracker range
  /// Standard deviation of one tracker direction, perpendicular to the beam.
  double sigma_angle_rad = 3e-6;
  /// Standard uncertainty of the offset common to all ranges. From a limit of error of 10 um for
  /// home position and reflector: 10 um / sqrt(3).
  double u_range_offset_m = 6e-6;
  /// Name of the place where the tracker stands. Runs with the same name have the same offset of
  /// the ranges, because home position and reflector are the same. Empty: every run has its own
  /// offset.
  std::string tracker_place{};
  std::optional<TrackerVertical> tracker_vertical;  ///< nullopt: not levelled
  /// position in machine axes, accurate to 0.5 m
  std::optional<std::array<double, 3>> tracker_position_m;
  [[nodiscard]] const AxisConfig* find_axis(std::string_view name) const noexcept;
  friend bool operator==(const MachineConfig&, const MachineConfig&) = default;
};

/// One [[thermal]] table: the readings of one axis are corrected for the thermal expansion of the
/// scale.
struct ThermalConfig {
  std::string axis;
  std::uint8_t temperature = 0;  ///< index into Config::temperatures
  double alpha_per_K = 0.0;      ///< expansion coefficient of the scale
  double u_alpha_per_K = 0.0;
  double u_temperature_K = 0.0;
  double fixed_m = 0.0;  ///< reading where the scale is fixed to the machine
};

/// Equation for the refractive index of air.
enum class AirEquation { Ciddor, Edlen, ShopFloor };

/// [air]: the refractive index of air, computed from measured values.
struct AirConfig {
  AirEquation equation = AirEquation::Ciddor;
  double wavelength_m = 633e-9;
  double co2_ppm = 450.0;
  double u_temperature_K = 0.2;
  double u_pressure_Pa = 30.0;
  double u_relative_humidity = 0.03;
  /// Standard uncertainty of the CO2 content, which is not measured: people and burners add 50 to
  /// 1000 ppm to the 430 ppm outdoors.
  double u_co2_ppm = 200.0;
  std::chrono::nanoseconds max_age{std::chrono::seconds{60}};  ///< an older value is not used
  /// The refractive index that the tracker used to compute its distances. If it is given, abbe
  /// corrects the distances for the measured air.
  std::optional<double> assumed_index;
};

/// Limits for the readings of one sensor, in K, Pa or as a ratio. One [[sensors.limit]] table.
/// nullopt: the default of the kind of sensor (sensor_options.hpp of pipeline).
struct SensorLimitConfig {
  /// one of Config::temperatures, "air_temperature", "air_pressure" or "relative_humidity"
  std::string name;
  std::optional<double> lowest, highest;
  std::optional<double> most_per_s;
  std::optional<double> tolerance;
  std::string twin;  ///< another temperature sensor at the same place, for comparison; empty: none
  double most_twin_difference_K = 1.0;
};

/// [sensors]: checks of the readings of all environment sensors.
struct SensorsConfig {
  bool check = true;
  /// for this time the last good value is used instead of readings that are refused
  std::chrono::nanoseconds hold{std::chrono::seconds{60}};
  /// if a sensor gives no reading for this time, its history is discarded
  std::chrono::nanoseconds forget{std::chrono::minutes{10}};
  /// largest difference of a first reading from the median of scales and air
  double start_spread_K = 15.0;
  /// limit of the rate at which the temperature that corrects a scale follows the sensor
  double correction_K_per_s = 1.0 / 60.0;
  std::vector<SensorLimitConfig> limits;
};

using drivers::RealTimeMode;

/// Table [daemon].
struct DaemonConfig {
  std::filesystem::path data_dir = "/var/lib/abbe";
  [[nodiscard]] std::filesystem::path models_dir() const { return data_dir / "models"; }
  std::filesystem::path runtime_dir = kRuntimeFolder;
  std::chrono::nanoseconds hub_period{std::chrono::microseconds{250}};
  /// The longest time for which the hub waits for samples of a stream that arrive late.
  std::chrono::nanoseconds watermark{std::chrono::milliseconds{600}};
  /// true: the devices are those of abbe-sim; only then may `speed` differ from 1
  bool simulated = false;
  double speed = 1.0;  ///< host time = speed x CLOCK_MONOTONIC
  RealTimeMode realtime = RealTimeMode::Ignore;
  int tracker_priority = 40;  ///< SCHED_FIFO, 1 to 99
  int encoder_priority = 50;
  int hub_priority = 30;
  std::optional<int> tracker_cpu;  ///< CPU core to which the tracker's device thread is bound
  std::optional<int> encoder_cpu;
  std::optional<int> hub_cpu;
  /// Limit of the wake-up latency of the CPU (/dev/cpu_dma_latency). nullopt: not requested.
  std::optional<std::chrono::microseconds> cpu_latency;
};

/// Table [recording].
struct RecordingConfig {
  std::filesystem::path dir;  ///< default: data_dir/recordings
  std::uint32_t chunk_bytes = 256 * 1024;
  /// A chunk of the recording is closed after this time, even if it has not reached chunk_bytes.
  std::chrono::nanoseconds chunk_period{std::chrono::seconds{1}};
  bool raw = true;  ///< true: also record the raw bytes of the devices
  /// If less disk space than this is free, recording stops; acquisition continues.
  std::uint64_t min_free_bytes = 256ull * 1024 * 1024;
  /// when a file has this size, the next part begins; 0: no limit
  std::uint64_t max_file_bytes = 4096ull * 1024 * 1024;
  /// Recordings older than this are removed, unless a model names them among its inputs; 0: never.
  std::chrono::hours keep{0};
};

/// [models]: which models the store keeps besides the models in force. A model is removed only if
/// it is older than `keep` and not among the `keep_newest` newest. A clock that is ahead therefore
/// removes none of the newest models.
struct ModelRetention {
  std::size_t keep_newest = 0;  ///< models added last that are kept at any age; 0: keep all
  /// [models] keep_days: models that were added more recently are kept
  std::chrono::hours keep{0};
};

/// [gate]: the conditions that a model must satisfy before it may become active.
struct GateConfig {
  double max_error_m = 1e-3;   ///< largest |V| inside the validity volume
  double max_gradient = 5e-3;  ///< largest |dV/dq|, m per m; 250 um between nodes 50 mm apart
  /// Largest allowed difference between the scale readings and a vertex of the commanded on-the-fly
  /// path, in addition to the uncertainty of the readings.
  double path_tolerance_m = 20e-6;
  /// Fraction of the legs of an on-the-fly run that are excluded from the fit, to check the model
  /// with them. For a ball array this value is not used: each position is excluded once.
  double holdout_fraction = 0.2;
  /// Conditions that the user accepts, by name:
  /// - "evemu-shape-only": a model from a ball array whose rotation about Ball1 is not referenced;
  /// - "smaller-volume": a model whose validity volume is smaller than that of the active model;
  /// - "scale-change": a model whose scale differs from that of the active model;
  /// - "path-orientation": a path file that may be rotated;
  /// - "bar-temperature": a bar more than 12 K from 20 C;
  /// - "bar-temperature-change": a bar warmer or colder at a position than at those next to it.
  std::vector<std::string> accept;

  [[nodiscard]] bool accepts(std::string_view name) const;
};

enum class OtfMode { OnTheFly, Standstill };
enum class OtfEstimator { TwoStep, Simultaneous };
/// Differences between both directions of travel: none, one per table, one per node.
enum class OtfBacklash { None, PerTable, PerNode };

/// [[tracker.nest]]: a reference nest beside the machine.
struct NestConfig {
  std::string name;
  std::array<double, 3> position_tracker_m{};  ///< approximate, tracker frame
  double radius_m = 10e-3;                     ///< a target closer to the position is in the nest
};

/// [otf]: calibration with a laser tracker along a path.
struct OtfConfig {
  OtfMode mode = OtfMode::OnTheFly;   ///< unless a request names another one
  double u_repeatability_m = 0.5e-6;  ///< repeatability of one standstill, per component
  OtfEstimator estimator = OtfEstimator::Simultaneous;  ///< estimator of on-the-fly mode
  OtfBacklash backlash = OtfBacklash::None;
  std::vector<NestConfig> nests{};
  double u_nest_repeatability_m = 3e-6;  ///< repeatability of one visit of a nest, per coordinate
  /// Prior for smooth tables of X, Y and Z: bend over three nodes 50 mm apart. 0: no prior for this
  /// axis.
  std::optional<std::array<double, 3>> smoothness_m{};
};

/// [drift]: comparison of the tables of a new run with those of the active model, and continuous
/// calibration (calib/model_drift, calib/model_update).
struct DriftConfig {
  bool test = true;   ///< a table that changed by more than its uncertainty raises DRIFT
  bool hold = false;  ///< a model of a run with drift is stored and not activated
  /// An accepted run updates the active model instead of replacing it.
  bool continuous = false;
  double forgetting = 1.0;  ///< factor of the previous information per run
  /// Process noise of every table: standard deviation of its change in a day.
  double length_m_per_root_day = 0.5e-6;
  double angle_rad_per_root_day = 1e-6;
  /// A tracker place that had no update for this time gets a new offset of the ranges.
  double place_days = 30.0;
  /// process noise of single tables by name, m or rad per root of a day
  std::map<std::string, double> of_tables{};
};

/// [evemu] artefact_sensor or artefact_C, [mfb] bar_sensor: temperature of an artefact while it is
/// touched.
struct ArtefactTemperatureConfig {
  std::optional<std::uint8_t> sensor;  ///< index into Config::temperatures
  double fixed_K = 293.15;             ///< temperature if there is no sensor
  /// standard uncertainty: of the sensor, and of the array's temperature relative to the sensor
  double u_temperature_K = 0.0;
};

/// [evemu]: calibration with a ball array.
struct EvemuConfig {
  std::string estimator = "bayes-pose";  ///< bayes-pose, ols, ridge, lasso, mcp, scad
  std::string folds = "position";        ///< position, ball, row: for lasso, mcp, scad
  int order = 3;                         ///< order of the error polynomials
  /// Positions of the array, in the order in which they are touched.
  std::vector<int> positions{4, 8, 3, 7, 2, 6, 1, 5};
  std::size_t points_per_ball = 25;
  std::size_t points_per_block = 25;
  /// The calibration fails if no touch arrives for longer than this.
  std::chrono::nanoseconds longest_pause{std::chrono::hours{1}};
  std::optional<ArtefactTemperatureConfig> artefact;  ///< nullopt: 20 C is assumed
};

/// [mfb]: calibration with a Multi-Feature Bar.
struct MfbConfig {
  /// Temperature of the bar during its passes; nullopt: plan.toml states it.
  std::optional<ArtefactTemperatureConfig> bar{};
};

/// [control]. Root and the daemon's user may send every request; see control_roles.hpp.
struct ControlConfig {
  std::filesystem::path socket;  ///< default: runtime_dir/control.sock
  /// Group whose members may read, and stop a machine; empty: all who may open the socket.
  std::string look_group;
  /// Group whose members may change models and calibrate; empty: only root and the daemon's user.
  std::string change_group = "abbe-change";
  /// Group whose members may move a machine; empty: only root and the daemon's user.
  std::string move_group = "abbe-move";
};

/// The whole file. A kind of device whose table is missing is not used; at most one device reads
/// the axes.
struct Config {
  MachineConfig machine;
  DeviceConfigs devices;
  /// Names of the elements of EnvironmentSample::temperature_K, in order of configuration.
  std::vector<std::string> temperatures;
  std::vector<ThermalConfig> thermal;
  AirConfig air;
  SensorsConfig sensors;
  DaemonConfig daemon;
  RecordingConfig recording;
  ModelRetention models;
  DdsConfig dds;
  GateConfig gate;
  OtfConfig otf;
  DriftConfig drift;
  EvemuConfig evemu;
  MfbConfig mfb{};
  ControlConfig control;
  /// The meaning of the readings, collected while the tables above were read.
  Meaning meaning;

  /// The devices of one kind, as in DeviceConfigs: an optional or a vector.
  template <class Kind>
  [[nodiscard]] auto& of() noexcept {
    return devices_of<Kind>(devices);
  }
  template <class Kind>
  [[nodiscard]] const auto& of() const noexcept {
    return devices_of<Kind>(devices);
  }

  /// The names of the axes in the samples of the device that reads the axes, in their order. Empty
  /// if no device reads the axes, or if the samples have the first axes of the machine.
  [[nodiscard]] std::vector<std::string> connected_axes() const;

  /// True if the control already corrects the readings of any axis.
  [[nodiscard]] bool axes_compensated() const;
};

/// Reads and checks a whole file. Io if the file cannot be read, else BadInput with one line per
/// fault in Error::details, at most 1000, each "file:line:column: key: what is wrong". A file with
/// a fault is not used at all.
[[nodiscard]] Result<Config> load_config(const std::filesystem::path& file);

/// Same as load_config() for the text of a file. `file` is used in error messages and is the base
/// of relative paths.
[[nodiscard]] Result<Config> parse_config(std::string_view text, const std::filesystem::path& file);

/// Same as parse_config() for the text in a recording, which must stay readable: implausible values
/// are accepted (a travel below 1 mm, a step above 1 mm, a host name that no resolver accepts).
[[nodiscard]] Result<Config> parse_recorded_config(std::string_view text,
                                                   const std::filesystem::path& file);

/// The part of Config::meaning that comes from [[environment]]: only sensors whose values correct a
/// reading. Adding or changing another sensor, which is only recorded, must not end a model.
[[nodiscard]] Meaning environment_meaning(const Config& config);

/// SHA-256 in hex over Meaning::readings: the machine and all that gives an axis reading its
/// meaning. A stored model is ACTIVE only if its hash equals that of the present configuration.
/// Noise values and transport settings are not included.
[[nodiscard]] std::string machine_hash(const Config& config);

/// The hash in model files of earlier versions, which do not list the configuration. It covers the
/// machine (name, chain, axes, target, nodes) and these properties of the readings: correction by
/// the control, axis, node or channel, step, offset, reference marks, expansion of the scale.
[[nodiscard]] std::string former_machine_hash(const Config& config);
/// The entries of `readings` that former_machine_hash() does not cover.
[[nodiscard]] MeaningEntries not_in_former_hash(MeaningEntries readings);

/// Replaces [target] offset_mm, for a run whose target offset does not come from the configuration.
void set_target_offset(Config& config, const std::array<double, 3>& offset_m);

}  // namespace abbe::daemon
