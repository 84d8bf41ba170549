#include "abbe/protocol/can/encoder_configurator.hpp"

#include "abbe/protocol/can/cia406.hpp"
#include "can/little_endian.hpp"

namespace abbe::protocol::can {

namespace {

/// Indices in the list of pdo_configuration().
constexpr std::size_t kDisable = 0, kClearMapping = 1, kMap = 2, kMapCount = 3, kType = 4,
                      kEnable = 7, kBeat = 8;

constexpr std::uint8_t kMostMapped = 8;
constexpr unsigned kPdoBits = 64;

}  // namespace

PdoConfiguration pdo_configuration(const EncoderPlan& plan) noexcept {
  const unsigned other = plan.tpdo == 1 ? 2 : 1;
  const auto parameter = [](unsigned number, std::uint8_t sub) {
    return ObjectId{static_cast<std::uint16_t>(object::kTpdoParameters + number - 1), sub};
  };

  const auto mapping = [&](std::uint8_t sub) {
    return ObjectId{static_cast<std::uint16_t>(object::kTpdoMapping + plan.tpdo - 1), sub};
  };

  const auto disabled = [&](unsigned number) {
    return cob::tpdo(number, plan.node) | object::kPdoDisabled | object::kPdoNoRemote;
  };

  return {{
      {parameter(plan.tpdo, 1), disabled(plan.tpdo), 4},
      {mapping(0), 0, 1},
      {mapping(1), encode_mapping(mapped_position(plan.position)), 4},
      {mapping(0), 1, 1},
      {parameter(plan.tpdo, 2), plan.sync_every, 1},
      {parameter(plan.tpdo, 3), 0, 2, true},
      {parameter(plan.tpdo, 5), 0, 2, true},
      {parameter(plan.tpdo, 1), cob::tpdo(plan.tpdo, plan.node) | object::kPdoNoRemote, 4},
      {object::kHeartbeatTime, plan.heartbeat_ms, 2, true},
      {parameter(other, 1), disabled(other), 4, true},
  }};
}

const char* to_text(ConfigurationFault fault) noexcept {
  switch (fault) {
    case ConfigurationFault::None:
      return "no fault";
    case ConfigurationFault::Silent:
      return "does not answer";
    case ConfigurationFault::Refused:
      return "refuses";
    case ConfigurationFault::NotAnEncoder:
      return "is no encoder (device profile 406)";
    case ConfigurationFault::WrongVendor:
      return "has another vendor";
    case ConfigurationFault::WrongProduct:
      return "is another product";
    case ConfigurationFault::WrongSerial:
      return "has another serial number";
    case ConfigurationFault::WrongKind:
      return "is not of the kind (linear, rotary) configured";
    case ConfigurationFault::NoScale:
      return "has no measuring step";
    case ConfigurationFault::WrongStep:
      return "has another measuring step than configured";
    case ConfigurationFault::FixedMapping:
      return "has a fixed mapping without the position (6004h)";
    case ConfigurationFault::FixedType:
      return "has a fixed transmission type that is not 1 (every SYNC)";
    case ConfigurationFault::NotOperational:
      return "is not operational";
    case ConfigurationFault::BadAnswer:
      return "sends malformed answers";
  }

  return "unknown fault";
}

EncoderConfigurator::EncoderConfigurator(const EncoderPlan& plan, SdoClientOptions options) noexcept
    : plan_(plan), sdo_(plan.node, options), writes_(pdo_configuration(plan)) {}

void EncoderConfigurator::start(HostTime now) noexcept {
  description_ = {};
  error_ = {};
  state_ = State::Working;
  step_ = Step::DeviceType;
  write_index_ = 0;
  while (sdo_.take_frame()) {
  }
  nmt_ = encode_nmt(NmtCommand::PreOperational, plan_.node);
  begin_step(now);
}

std::optional<CanFrame> EncoderConfigurator::take_frame() noexcept {
  if (nmt_ && state_ != State::Ready) {
    const auto frame = nmt_;
    nmt_.reset();
    return frame;
  }
  if (const auto frame = sdo_.take_frame()) return frame;
  const auto frame = nmt_;
  nmt_.reset();
  return frame;
}

void EncoderConfigurator::on_frame(const CanFrame& frame, HostTime now) noexcept {
  if (state_ != State::Working) return;
  sdo_.on_frame(frame, now);
  advance(now);
}

void EncoderConfigurator::on_time(HostTime now) noexcept {
  if (state_ != State::Working) return;
  sdo_.on_time(now);
  advance(now);
}

void EncoderConfigurator::begin_step(HostTime now) noexcept {
  switch (step_) {
    case Step::DeviceType:
      return sdo_.start_upload(object::kDeviceType, now);
    case Step::Vendor:
      return sdo_.start_upload(object::kVendor, now);
    case Step::Product:
      return sdo_.start_upload(object::kProduct, now);
    case Step::Revision:
      return sdo_.start_upload(object::kRevision, now);
    case Step::Serial:
      return sdo_.start_upload(object::kSerial, now);
    case Step::Operating:
      return sdo_.start_upload(object::kOperatingParameters, now);
    case Step::Scale: {
      const bool linear = object::is_linear(description_.device_type);
      return sdo_.start_upload(linear ? object::kPositionStep : object::kUnitsPerRevolution, now);
    }
    case Step::ScaleFallback:
      return sdo_.start_upload(object::kMeasuringStep, now);
    case Step::Range:
      return sdo_.start_upload(object::kTotalRange, now);
    case Step::Revolutions:
      return sdo_.start_upload(object::kRevolutions, now);
    case Step::Write:
      return write_number(writes_[write_index_], now);
    case Step::MappingCount:
      return sdo_.start_upload(writes_[kClearMapping].object, now);
    case Step::MappingEntry:
      return sdo_.start_upload({writes_[kMap].object.index, entry_}, now);
    case Step::FirstEntry:
      return sdo_.start_upload(writes_[kMap].object, now);
    case Step::Type:
      return sdo_.start_upload(writes_[kType].object, now);
    case Step::CobId:
      return sdo_.start_upload(writes_[kEnable].object, now);
    case Step::Heartbeat:
      return sdo_.start_upload(object::kHeartbeatTime, now);
  }
}

void EncoderConfigurator::write_number(const SdoWrite& write, HostTime now) noexcept {
  std::array<std::byte, 4> bytes{};
  store_le(std::span{bytes}, 0, write.value);
  sdo_.start_download(write.object, std::span{bytes}.first(write.size), now);
}

void EncoderConfigurator::advance(HostTime now) noexcept {
  if (sdo_.state() == SdoClient::State::Failed) {
    if (read_instead()) return begin_step(now);
    if (step_ >= Step::MappingCount && step_ != Step::Heartbeat && sdo_.aborted_by_server())
      return fail_as_refused();
    if (tolerated()) return next_step(now);
    if (sdo_.aborted_by_server()) return fail(ConfigurationFault::Refused, 0);
    const bool silent = sdo_.abort_code() == AbortCode::Timeout;
    return fail(silent ? ConfigurationFault::Silent : ConfigurationFault::BadAnswer, 0);
  }

  if (sdo_.state() != SdoClient::State::Done) return;
  if (step_ != Step::Write) {
    const auto value = sdo_.number();
    if (!value || *value > 0xFFFFFFFF) return fail(ConfigurationFault::BadAnswer, 0);
    if (!take_number(static_cast<std::uint32_t>(*value))) return;
  }

  next_step(now);
}

/// True if the node refused the step with "object does not exist" and the object is not required.
/// In 1018h only sub-index 01 is mandatory.
bool EncoderConfigurator::tolerated() const noexcept {
  if (!sdo_.aborted_by_server()) return false;
  switch (step_) {
    case Step::Write:
      return writes_[write_index_].optional;
    case Step::Operating:
    case Step::Revolutions:
    case Step::Heartbeat:
      return true;
    case Step::Vendor:
      return !plan_.vendor;
    case Step::Product:
      return !plan_.product;
    case Step::Revision:
      return true;
    case Step::Serial:
      return !plan_.serial;
    case Step::Scale:
    case Step::ScaleFallback:
    case Step::Range:
      return true;  // a missing scale is an error only with needs_scale: see next_step()
    case Step::DeviceType:
    case Step::MappingCount:
    case Step::MappingEntry:
    case Step::FirstEntry:
    case Step::Type:
    case Step::CobId:
      return false;
  }

  return false;
}

bool EncoderConfigurator::take_number(std::uint32_t value) noexcept {
  const auto must_be = [&](const std::optional<std::uint32_t>& wanted, ConfigurationFault fault) {
    if (wanted && *wanted != value) fail(fault, value);
    return state_ == State::Working;
  };

  switch (step_) {
    case Step::DeviceType:
      check_device_type(value);
      return state_ == State::Working;
    case Step::Vendor:
      description_.vendor = value;
      return must_be(plan_.vendor, ConfigurationFault::WrongVendor);
    case Step::Product:
      description_.product = value;
      return must_be(plan_.product, ConfigurationFault::WrongProduct);
    case Step::Revision:
      description_.revision = value;
      return true;
    case Step::Serial:
      description_.serial = value;
      return must_be(plan_.serial, ConfigurationFault::WrongSerial);
    case Step::Operating:
      description_.operating_parameters = value;
      return true;
    case Step::Scale:
    case Step::ScaleFallback:
      (object::is_linear(description_.device_type) ? description_.step_nm
                                                   : description_.units_per_revolution) = value;
      if (value != 0) check_step();
      return state_ == State::Working;
    case Step::Range:
      description_.total_range = value;
      return true;
    case Step::Revolutions:
      description_.revolutions = value;
      return true;
    case Step::MappingCount:
    case Step::MappingEntry:
    case Step::FirstEntry:
      take_mapping(value);
      return state_ == State::Working;
    case Step::Type:
      if (value == plan_.sync_every) return true;
      if (!is_lasting(refusal_.abort_code)) {
        fail_as_refused();
      } else {
        fail(ConfigurationFault::FixedType, value);
      }
      return state_ == State::Working;
    case Step::CobId:
      if ((value & ~object::kPdoNoRemote) != cob::tpdo(plan_.tpdo, plan_.node)) fail_as_refused();
      return state_ == State::Working;
    case Step::Heartbeat:
    case Step::Write:
      return true;
  }

  return true;
}

/// Called after a refused write: true if the object is read instead. The refusal is stored; it is
/// reported if the value read is not acceptable.
bool EncoderConfigurator::read_instead() noexcept {
  if (step_ != Step::Write || !sdo_.aborted_by_server()) return false;
  refusal_ = {ConfigurationFault::Refused, sdo_.object(), sdo_.abort_code(), 0};
  switch (write_index_) {
    case kDisable:
    case kClearMapping:
      step_ = Step::MappingCount;
      return true;
    case kMap:
      step_ = Step::FirstEntry;  // the number of entries is already 0
      return true;
    case kType:
      step_ = Step::Type;
      return true;
    case kEnable:
      step_ = Step::CobId;
      return true;
    case kBeat:
      step_ = Step::Heartbeat;  // the heartbeat period is not checked here
      return true;
    default:
      return false;
  }
}

bool EncoderConfigurator::is_position(std::uint32_t entry) const noexcept {
  const auto wanted = mapped_position(plan_.position);
  const auto mapped = decode_mapping(entry);
  const bool multi_sensor = ObjectId{mapped.index, mapped.sub} == object::kMultiPosition;
  return mapped == wanted || (multi_sensor && mapped.bits == wanted.bits);
}

void EncoderConfigurator::take_mapping(std::uint32_t value) noexcept {
  if (step_ == Step::FirstEntry) {
    if (!is_position(value)) fail_as_refused();
    return;
  }

  if (step_ == Step::MappingCount) {
    mapped_ = static_cast<std::uint8_t>(value <= kMostMapped ? value : 0);
    entry_ = 0;
    bits_before_ = 0;
  } else if (is_position(value) && bits_before_ % 8 == 0) {
    description_.fixed_mapping = true;
    description_.position_byte = static_cast<std::uint8_t>(bits_before_ / 8);
    return;
  } else {
    bits_before_ += decode_mapping(value).bits;
  }

  if (++entry_ > mapped_ || bits_before_ >= kPdoBits) {
    if (!is_lasting(refusal_.abort_code)) return fail_as_refused();
    fail(ConfigurationFault::FixedMapping, 0);
    error_.object = {writes_[kMap].object.index, 0};
  }
}

void EncoderConfigurator::fail_as_refused() noexcept {
  state_ = State::Failed;
  error_ = refusal_;
}

bool EncoderConfigurator::scaling_off() const noexcept {
  const auto parameters = description_.operating_parameters;
  return parameters && (*parameters & object::kScalingOn) == 0;
}

/// Compares the step that the node reports with the configured one.
void EncoderConfigurator::check_step() noexcept {
  constexpr double kHalf_nm = 0.5;
  constexpr double kRounded = 1e-5;  // for a step rounded to nrad; 13 arcsec per revolution
  const auto differs = [](double seen, double wanted, double tolerance) {
    return seen - wanted > tolerance || wanted - seen > tolerance;
  };
  if (description_.step_nm && plan_.step_nm &&
      differs(*description_.step_nm, *plan_.step_nm, kHalf_nm))
    return fail(ConfigurationFault::WrongStep, *description_.step_nm);
  const auto units = description_.units_per_revolution;
  const auto wanted = plan_.units_per_revolution;
  if (units && wanted && differs(*units, *wanted, kRounded * *wanted))
    fail(ConfigurationFault::WrongStep, *units);
}

void EncoderConfigurator::check_device_type(std::uint32_t value) noexcept {
  description_.device_type = value;
  if (!object::is_encoder(value)) return fail(ConfigurationFault::NotAnEncoder, value);
  if (plan_.linear && *plan_.linear != object::is_linear(value))
    fail(ConfigurationFault::WrongKind, value);
}

bool EncoderConfigurator::scale_known() const noexcept {
  return description_.step_nm.value_or(0) != 0 ||
         description_.units_per_revolution.value_or(0) != 0;
}

EncoderConfigurator::Step EncoderConfigurator::after_scale() const noexcept {
  if (object::is_linear(description_.device_type)) return Step::Write;
  return scaling_off() ? Step::Revolutions : Step::Range;
}

void EncoderConfigurator::next_write() noexcept {
  step_ = Step::Write;
  if (++write_index_ < writes_.size()) return;
  state_ = State::Ready;
  nmt_ = encode_nmt(NmtCommand::Start, plan_.node);
}

void EncoderConfigurator::next_step(HostTime now) noexcept {
  const bool linear = object::is_linear(description_.device_type);
  switch (step_) {
    case Step::Serial:
      step_ = linear ? Step::Scale : Step::Operating;
      break;
    case Step::Operating:
      step_ = scaling_off() ? Step::ScaleFallback : Step::Scale;
      break;
    case Step::Scale:
      if (!scale_known()) {
        step_ = Step::ScaleFallback;
        break;
      }
      [[fallthrough]];
    case Step::ScaleFallback:
      if (plan_.needs_scale && !scale_known()) return fail(ConfigurationFault::NoScale, 0);
      step_ = after_scale();
      break;
    case Step::Range:
    case Step::Revolutions:
      step_ = Step::Write;
      break;
    case Step::MappingCount:
    case Step::MappingEntry:
      step_ = Step::MappingEntry;
      if (!description_.fixed_mapping) break;
      write_index_ = kMapCount;
      next_write();
      break;
    case Step::Write:
    case Step::FirstEntry:
    case Step::Type:
    case Step::CobId:
    case Step::Heartbeat:
      next_write();
      break;
    default:
      step_ = static_cast<Step>(static_cast<std::uint8_t>(step_) + 1);
  }

  if (state_ == State::Working) begin_step(now);
}

void EncoderConfigurator::fail(ConfigurationFault fault, std::uint32_t seen) noexcept {
  state_ = State::Failed;
  error_ = {fault, sdo_.object(), sdo_.abort_code(), seen};
}

}  // namespace abbe::protocol::can
