#pragma once
/// The layout of every packet. Reading, writing and counting use the same definition, so both
/// directions always agree. The offsets follow from the order of the fields, because the structures
/// are packed to 4 bytes and have no padding.

#include <array>
#include <concepts>
#include <cstddef>
#include <cstdint>
#include <type_traits>

#include "abbe/protocol/bytes.hpp"
#include "abbe/protocol/emscon/answers.hpp"
#include "abbe/protocol/emscon/requests.hpp"
#include "abbe/protocol/emscon/results.hpp"

namespace abbe::protocol::emscon::wire {

template <class P>
inline constexpr bool kIsSetting = false;
template <class Set, Command kId>
inline constexpr bool kIsSetting<SettingAnswer<Set, kId>> = true;

/// True if T is P, a packet or a part of one. T is const P when the fields are written to the wire.
template <class T, class P>
concept Is = std::is_same_v<std::remove_const_t<T>, P>;
template <class T>
concept IsSetting = kIsSetting<std::remove_const_t<T>>;
/// The requests without parameters.
template <class T>
concept HasNoFields = std::is_empty_v<std::remove_const_t<T>>;

// One overload for each structure: a structure without one does not compile. Each calls
// io(field, ...) with the fields after the common head of its kind of packet.

template <HasNoFields P, class Io>
constexpr void fields(P&, Io&&) ABBE_RT {}

template <Is<Acknowledge> P, class Io>
constexpr void fields(P&, Io&&) ABBE_RT {}

template <Is<Units> P, class Io>
constexpr void fields(P& p, Io&& io) ABBE_RT {
  io(p.length, p.angle, p.temperature, p.pressure, p.humidity);
}

template <Is<Environment> P, class Io>
constexpr void fields(P& p, Io&& io) ABBE_RT {
  io(p.temperature, p.pressure, p.humidity);
}

template <Is<Refraction> P, class Io>
constexpr void fields(P& p, Io&& io) ABBE_RT {
  io(p.n_interferometer, p.n_adm);
}

template <Is<SystemSettings> P, class Io>
constexpr void fields(P& p, Io&& io) ABBE_RT {
  io(p.weather_monitor, p.apply_transformation, p.apply_station_orientation, p.keep_last_position,
     p.send_unsolicited_messages, p.send_reflector_position, p.try_mode, p.has_nivel,
     p.has_video_camera);
}

template <Is<TrackerClockReading> P, class Io>
constexpr void fields(P& p, Io&& io) ABBE_RT {
  io(p.seconds, p.microseconds);
}

template <Is<SetUnits> P, class Io>
constexpr void fields(P& p, Io&& io) ABBE_RT {
  io(p.units);
}

template <Is<SetStationOrientation> P, class Io>
constexpr void fields(P& p, Io&& io) ABBE_RT {
  io(p.translation, p.rotation);
}

template <Is<SetTransformation> P, class Io>
constexpr void fields(P& p, Io&& io) ABBE_RT {
  io(p.translation, p.rotation, p.scale);
}

template <Is<SetEnvironmentParams> P, class Io>
constexpr void fields(P& p, Io&& io) ABBE_RT {
  io(p.environment);
}

template <Is<SetRefractionParams> P, class Io>
constexpr void fields(P& p, Io&& io) ABBE_RT {
  io(p.refraction);
}

template <Is<SetMeasurementMode> P, class Io>
constexpr void fields(P& p, Io&& io) ABBE_RT {
  io(p.mode);
}

template <Is<SetCoordinateSystemType> P, class Io>
constexpr void fields(P& p, Io&& io) ABBE_RT {
  io(p.type);
}

template <Is<SetStationaryModeParams> P, class Io>
constexpr void fields(P& p, Io&& io) ABBE_RT {
  io(p.measurement_time_ms, p.use_adm);
}

template <Is<SetContinuousTimeModeParams> P, class Io>
constexpr void fields(P& p, Io&& io) ABBE_RT {
  io(p.time_separation_ms, p.number_of_points, p.use_region, p.region_type);
}

template <Is<SetContinuousDistanceModeParams> P, class Io>
constexpr void fields(P& p, Io&& io) ABBE_RT {
  io(p.spatial_distance, p.number_of_points, p.use_region, p.region_type);
}

template <Is<SetReflector> P, class Io>
constexpr void fields(P& p, Io&& io) ABBE_RT {
  io(p.internal_id);
}

template <Is<SetSearchParams> P, class Io>
constexpr void fields(P& p, Io&& io) ABBE_RT {
  io(p.radius, p.timeout_ms);
}

template <Is<SetSystemSettings> P, class Io>
constexpr void fields(P& p, Io&& io) ABBE_RT {
  io(p.settings);
}

template <Is<GoPosition> P, class Io>
constexpr void fields(P& p, Io&& io) ABBE_RT {
  io(p.position, p.use_adm);
}

template <Is<FindReflector> P, class Io>
constexpr void fields(P& p, Io&& io) ABBE_RT {
  io(p.approximate_distance);
}

template <Is<SetStatisticMode> P, class Io>
constexpr void fields(P& p, Io&& io) ABBE_RT {
  io(p.stationary, p.continuous);
}

template <Is<SetTriggerSource> P, class Io>
constexpr void fields(P& p, Io&& io) ABBE_RT {
  io(p.source);
}

template <Is<SetExternTriggerParams> P, class Io>
constexpr void fields(P& p, Io&& io) ABBE_RT {
  io(p.clock_transition, p.mode, p.start_signal, p.minimal_time_delay);
}

template <Is<SetLongSystemParameter> P, class Io>
constexpr void fields(P& p, Io&& io) ABBE_RT {
  io(p.parameter, p.value);
}

template <Is<GetLongSystemParameter> P, class Io>
constexpr void fields(P& p, Io&& io) ABBE_RT {
  io(p.parameter);
}

template <Is<SystemStatusAnswer> P, class Io>
constexpr void fields(P& p, Io&& io) ABBE_RT {
  io(p.last_result, p.tracker_processor, p.laser, p.adm, p.version_major, p.version_minor,
     p.version_build, p.weather_monitor, p.flags, p.serial_number);
}

template <Is<TrackerStatusAnswer> P, class Io>
constexpr void fields(P& p, Io&& io) ABBE_RT {
  io(p.tracker);
}

template <Is<UnitsAnswer> P, class Io>
constexpr void fields(P& p, Io&& io) ABBE_RT {
  io(p.units);
}

template <Is<EnvironmentAnswer> P, class Io>
constexpr void fields(P& p, Io&& io) ABBE_RT {
  io(p.environment);
}

template <Is<RefractionAnswer> P, class Io>
constexpr void fields(P& p, Io&& io) ABBE_RT {
  io(p.refraction);
}

template <Is<ReflectorAnswer> P, class Io>
constexpr void fields(P& p, Io&& io) ABBE_RT {
  io(p.internal_id);
}

template <Is<ReflectorsAnswer> P, class Io>
constexpr void fields(P& p, Io&& io) ABBE_RT {
  io(p.total, p.internal_id, p.target_type, p.surface_offset, p.name);
}

template <Is<SystemSettingsAnswer> P, class Io>
constexpr void fields(P& p, Io&& io) ABBE_RT {
  io(p.settings);
}

template <Is<LongSystemParameterAnswer> P, class Io>
constexpr void fields(P& p, Io&& io) ABBE_RT {
  io(p.parameter, p.value);
}

template <Is<MeasurementStatusInfoAnswer> P, class Io>
constexpr void fields(P& p, Io&& io) ABBE_RT {
  io(p.last_result, p.bits);
}

template <Is<ObjectTemperatureAnswer> P, class Io>
constexpr void fields(P& p, Io&& io) ABBE_RT {
  io(p.temperature);
}

template <Is<TriggerBoardInfoAnswer> P, class Io>
constexpr void fields(P& p, Io&& io) ABBE_RT {
  io(p.card_type, p.fpga_version, p.max_trigger_frequency_hz, p.error);
}

template <Is<TrackerInfoAnswer> P, class Io>
constexpr void fields(P& p, Io&& io) ABBE_RT {
  io(p.sensor_type, p.name, p.serial_number, p.other, p.max_data_rate_hz, p.more);
}

template <IsSetting P, class Io>
constexpr void fields(P& p, Io&& io) ABBE_RT {
  io(p.set);
}

template <Is<ErrorResponse> P, class Io>
constexpr void fields(P& p, Io&& io) ABBE_RT {
  io(p.command, p.status);
}

template <Is<StatusChange> P, class Io>
constexpr void fields(P& p, Io&& io) ABBE_RT {
  io(p.event);
}

template <Is<SingleResult> P, class Io>
constexpr void fields(P& p, Io&& io) ABBE_RT {
  io(p.status, p.mode, p.try_mode, p.value, p.std_dev, p.std_total, p.pointing_error, p.apriori_std,
     p.apriori_total, p.environment);
}

template <Is<ReflectorPosition> P, class Io>
constexpr void fields(P& p, Io&& io) ABBE_RT {
  io(p.status, p.value);
}

template <Is<MultiPoint> P, class Io>
constexpr void fields(P& p, Io&& io) ABBE_RT {
  io(p.status, p.time, p.value);
}

template <Is<MultiPointStatistics> P, class Io>
constexpr void fields(P& p, Io&& io) ABBE_RT {
  io(p.apriori_std, p.apriori_total, p.covariance);
}

template <Is<ExtendedMultiPoint> P, class Io>
constexpr void fields(P& p, Io&& io) ABBE_RT {
  io(p.point, p.statistics);
}

template <class T>
inline constexpr bool kIsArray = false;
template <class T, std::size_t N>
inline constexpr bool kIsArray<std::array<T, N>> = true;

struct Counter {
  std::size_t size = 0;

  template <class... F>
  constexpr void operator()(F&... f) ABBE_RT {
    (one(f), ...);
  }
  template <class F>
  constexpr void one(F& f) ABBE_RT {
    using T = std::remove_const_t<F>;
    if constexpr (std::is_same_v<T, bool>) {
      size += sizeof(std::int32_t);
    } else if constexpr (WireScalar<T> || kIsArray<T>) {
      size += sizeof(T);
    } else {
      fields(f, *this);
    }
  }
};

struct Reader {
  ByteReader& bytes;

  template <class... F>
  void operator()(F&... f) const ABBE_RT {
    (one(f), ...);
  }
  template <class F>
  void one(F& f) const ABBE_RT {
    if constexpr (std::is_same_v<F, bool>) {
      f = bytes.little<std::int32_t>() != 0;
    } else if constexpr (WireScalar<F>) {
      f = bytes.little<F>();
    } else if constexpr (kIsArray<F>) {
      for (auto& element : f) one(element);
    } else {
      fields(f, *this);
    }
  }
};

struct Writer {
  ByteWriter& bytes;

  template <class... F>
  void operator()(const F&... f) const ABBE_RT {
    (one(f), ...);
  }
  template <class F>
  void one(const F& f) const ABBE_RT {
    if constexpr (std::is_same_v<F, bool>) {
      bytes.little(std::int32_t{f});
    } else if constexpr (WireScalar<F>) {
      bytes.little(f);
    } else if constexpr (kIsArray<F>) {
      for (const auto& element : f) one(element);
    } else {
      fields(f, *this);
    }
  }
};

/// Size of the fields of P on the wire, in bytes.
template <class P>
[[nodiscard]] constexpr std::size_t size_of() ABBE_RT {
  P p{};
  Counter counter;
  fields(p, counter);
  return counter.size;
}

inline void put_header(ByteWriter& out, std::size_t size, PacketType type) ABBE_RT {
  out.little(static_cast<std::int32_t>(size));
  out.little(type);
}

/// Size and type of a complete packet.
struct Header {
  std::size_t size = 0;
  PacketType type{};
};
[[nodiscard]] inline tl::expected<Header, DecodeError> take_header(ByteReader& in) ABBE_RT {
  const std::size_t available = in.remaining();
  const auto size = in.little<std::uint32_t>();
  const auto type = in.little<PacketType>();
  if (!in.ok()) return tl::unexpected{DecodeError::Truncated};
  if (size != available)
    return tl::unexpected{size > available ? DecodeError::Truncated : DecodeError::SizeMismatch};
  return Header{size, type};
}

}  // namespace abbe::protocol::emscon::wire
