#include "abbe/protocol/can/encoder_configurator.hpp"

#include "abbe/protocol/can/cia406.hpp"
#include "can/little_endian.hpp"

namespace abbe::protocol::can {

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
      {object::kHeartbeatTime, plan.heartbeat_ms, 2},
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
    case ConfigurationFault::BadAnswer:
      return "answers nonsense";
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
    case Step::Scale: {
      const bool linear = object::is_linear(description_.device_type);
      return sdo_.start_upload(linear ? object::kPositionStep : object::kUnitsPerRevolution, now);
    }
    case Step::ScaleFallback:
      return sdo_.start_upload(object::kMeasuringStep, now);
    case Step::Range:
      return sdo_.start_upload(object::kTotalRange, now);
    case Step::Write:
      return write_number(writes_[write_index_], now);
  }
}

void EncoderConfigurator::write_number(const SdoWrite& write, HostTime now) noexcept {
  std::array<std::byte, 4> bytes{};
  store_le(std::span{bytes}, 0, write.value);
  sdo_.start_download(write.object, std::span{bytes}.first(write.size), now);
}

void EncoderConfigurator::advance(HostTime now) noexcept {
  if (sdo_.state() == SdoClient::State::Failed) {
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

/// A refusal that says "I have no such object" where the object is not essential. 1018h has only :01 for
/// certain.
bool EncoderConfigurator::tolerated() const noexcept {
  if (!sdo_.aborted_by_server()) return false;
  switch (step_) {
    case Step::Write:
      return writes_[write_index_].optional;
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
      return true;  // the caller may know the scale; if not it refuses
    case Step::DeviceType:
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
    case Step::Scale:
    case Step::ScaleFallback:
      (object::is_linear(description_.device_type) ? description_.step_nm
                                                   : description_.units_per_revolution) = value;
      return true;
    case Step::Range:
      description_.total_range = value;
      return true;
    case Step::Write:
      return true;
  }
  return true;
}

void EncoderConfigurator::check_device_type(std::uint32_t value) noexcept {
  description_.device_type = value;
  if (!object::is_encoder(value)) return fail(ConfigurationFault::NotAnEncoder, value);
  if (plan_.linear && *plan_.linear != object::is_linear(value)) fail(ConfigurationFault::WrongKind, value);
}

bool EncoderConfigurator::scale_known() const noexcept {
  return description_.step_nm.value_or(0) != 0 || description_.units_per_revolution.value_or(0) != 0;
}

void EncoderConfigurator::next_step(HostTime now) noexcept {
  const bool linear = object::is_linear(description_.device_type);
  if (step_ == Step::Write) {
    if (++write_index_ == writes_.size()) {
      state_ = State::Ready;
      nmt_ = encode_nmt(NmtCommand::Start, plan_.node);
      return;
    }
  } else if (step_ == Step::Scale && !scale_known()) {
    step_ = Step::ScaleFallback;
  } else if (step_ == Step::Scale || step_ == Step::ScaleFallback) {
    if (plan_.needs_scale && !scale_known()) return fail(ConfigurationFault::NoScale, 0);
    step_ = linear ? Step::Write : Step::Range;
  } else {
    step_ = static_cast<Step>(static_cast<std::uint8_t>(step_) + 1);
  }
  begin_step(now);
}

void EncoderConfigurator::fail(ConfigurationFault fault, std::uint32_t seen) noexcept {
  state_ = State::Failed;
  error_ = {fault, sdo_.object(), sdo_.abort_code(), seen};
}

}  // namespace abbe::protocol::can
