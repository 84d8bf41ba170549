#pragma once
/// Brings one encoder from any state to "sends its position at every SYNC"
/// [CiA 301: PDO configuration order]. Sans-I/O like the SdoClient it drives: frames and a time in,
/// frames out. No allocation. Not thread-safe.
///
/// Order: NMT pre-operational; read 1000h and 1018h and check them; read the step and check it
/// (6005h:01, else 6501h; rotary: 6001h where 6000h says that scaling is on, else 6501h); disable
/// the TPDO; clear its mapping; map the position; set the count; transmission type, inhibit time,
/// event timer; enable it; heartbeat; disable the other default TPDO; NMT start.
///
/// An encoder that refuses a write is read: one with a fixed mapping, transmission type or
/// identifier is as good if that is what is needed, and one without a settable heartbeat is watched
/// by its positions.

#include <array>
#include <cstddef>
#include <cstdint>
#include <optional>

#include "abbe/protocol/can/canopen.hpp"
#include "abbe/protocol/can/pdo.hpp"
#include "abbe/protocol/can/sdo.hpp"
#include "abbe/protocol/can/sdo_client.hpp"
#include "abbe/protocol/time.hpp"

namespace abbe::protocol::can {

/// What the encoder shall do, and what it must be.
struct EncoderPlan {
  NodeId node = 1;
  PositionType position = PositionType::Signed32;
  std::uint8_t tpdo = 1;        ///< 1 or 2
  std::uint8_t sync_every = 1;  ///< 1..240: transmission type
  std::uint16_t heartbeat_ms = 100;
  std::optional<std::uint32_t> vendor{};  ///< checked against 1018h when given
  std::optional<std::uint32_t> product{};
  std::optional<std::uint32_t> serial{};
  std::optional<bool> linear{};  ///< checked against 1000h when given
  bool needs_scale = false;      ///< a node that does not know its step, or says 0, is refused
  std::optional<double>
      step_nm{};  ///< linear: what it must be, if the node says it, within half a nm
  std::optional<double> units_per_revolution{};  ///< rotary: the same, within 1e-5
};

/// One SDO write of the procedure.
struct SdoWrite {
  ObjectId object;
  std::uint32_t value = 0;
  std::uint8_t size = 0;
  bool optional = false;  ///< a node without this object is as good
};
/// Steps 2 to 8 as a list.
using PdoConfiguration = std::array<SdoWrite, 10>;
[[nodiscard]] PdoConfiguration pdo_configuration(const EncoderPlan& plan) noexcept;

/// What the encoder said about itself.
struct EncoderDescription {
  std::uint32_t device_type = 0;
  std::uint32_t vendor = 0;
  std::uint32_t product = 0;
  std::uint32_t revision = 0;
  std::uint32_t serial = 0;
  std::optional<std::uint32_t> step_nm;  ///< linear, as read: 0 is for the caller to refuse
  std::optional<std::uint32_t> operating_parameters;  ///< rotary: 6000h
  std::optional<std::uint32_t> units_per_revolution;  ///< rotary
  std::optional<std::uint32_t> total_range;  ///< rotary: counts after which the position wraps
  std::optional<std::uint32_t> revolutions;  ///< rotary without scaling: 6502h
  bool fixed_mapping = false;      ///< its TPDO could not be mapped, and holds the position
  std::uint8_t position_byte = 0;  ///< where in the TPDO the position begins
};

enum class ConfigurationFault : std::uint8_t {
  None,
  Silent,          ///< no answer, all retries used
  Refused,         ///< SDO abort by the node: `abort_code`
  NotAnEncoder,    ///< 1000h does not say profile 406: `seen`
  WrongVendor,     ///< `seen`
  WrongProduct,    ///< `seen`
  WrongSerial,     ///< `seen`
  WrongKind,       ///< linear instead of rotary or the other way round: `seen`
  NoScale,         ///< the step is 0 or unknown, and needed
  WrongStep,       ///< not the step that is configured: `seen`
  FixedMapping,    ///< its TPDO cannot be mapped and does not hold the position
  FixedType,       ///< its TPDO cannot be made to come at every SYNC: `seen`, the transmission type
  NotOperational,  ///< it left that state by itself, after it was configured
  BadAnswer,       ///< an answer that is no number, or a protocol error
};
struct ConfigurationError {
  ConfigurationFault fault = ConfigurationFault::None;
  ObjectId object;
  AbortCode abort_code = AbortCode::None;
  std::uint32_t seen = 0;
};
/// "does not answer", "refused", ... Static storage.
[[nodiscard]] const char* to_text(ConfigurationFault fault) noexcept;

class EncoderConfigurator {
 public:
  enum class State : std::uint8_t { Idle, Working, Ready, Failed };

  explicit EncoderConfigurator(const EncoderPlan& plan, SdoClientOptions options = {}) noexcept;

  void start(HostTime now) noexcept;
  void on_frame(const CanFrame& frame, HostTime now) noexcept;
  void on_time(HostTime now) noexcept;
  /// The next frame to send, until nullopt.
  [[nodiscard]] std::optional<CanFrame> take_frame() noexcept;

  [[nodiscard]] State state() const noexcept { return state_; }
  [[nodiscard]] HostTime deadline() const noexcept { return sdo_.deadline(); }
  [[nodiscard]] const EncoderPlan& plan() const noexcept { return plan_; }
  [[nodiscard]] const EncoderDescription& description() const noexcept { return description_; }
  [[nodiscard]] const ConfigurationError& error() const noexcept { return error_; }

 private:
  enum class Step : std::uint8_t {
    DeviceType,
    Vendor,
    Product,
    Revision,
    Serial,
    Operating,
    Scale,
    ScaleFallback,
    Range,
    Revolutions,
    Write,
    MappingCount,  ///< from here on: what a write was refused for is read
    MappingEntry,
    FirstEntry,
    Type,
    CobId,
    Heartbeat,
  };

  void advance(HostTime now) noexcept;
  void begin_step(HostTime now) noexcept;
  void next_step(HostTime now) noexcept;
  [[nodiscard]] bool scale_known() const noexcept;
  void check_device_type(std::uint32_t value) noexcept;
  void check_step() noexcept;
  [[nodiscard]] bool scaling_off() const noexcept;
  [[nodiscard]] Step after_scale() const noexcept;
  [[nodiscard]] bool read_instead() noexcept;
  void take_mapping(std::uint32_t value) noexcept;
  [[nodiscard]] bool is_position(std::uint32_t entry) const noexcept;
  void next_write() noexcept;
  void fail_as_refused() noexcept;
  void write_number(const SdoWrite& write, HostTime now) noexcept;
  [[nodiscard]] bool take_number(std::uint32_t value) noexcept;
  [[nodiscard]] bool tolerated() const noexcept;
  void fail(ConfigurationFault fault, std::uint32_t seen) noexcept;

  EncoderPlan plan_;
  SdoClient sdo_;
  PdoConfiguration writes_;
  EncoderDescription description_;
  ConfigurationError error_;
  State state_ = State::Idle;
  Step step_ = Step::DeviceType;
  std::size_t write_index_ = 0;
  ConfigurationError refusal_;   ///< of the write whose object is read instead
  std::uint8_t mapped_ = 0;      ///< entries of the fixed mapping
  std::uint8_t entry_ = 0;       ///< the one being read
  unsigned bits_before_ = 0;     ///< the position
  std::optional<CanFrame> nmt_;  ///< goes out before anything of the SDO client
};

}  // namespace abbe::protocol::can
