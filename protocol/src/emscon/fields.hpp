#pragma once
/// The layout of every packet. Reading, writing and counting use the same definition, so both
/// directions always agree. The offsets follow from the order of the fields, because the structures
/// are packed to 4 bytes and have no padding.

#include <array>
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

template <class T, class Packet>
inline constexpr bool kIs = std::is_same_v<std::remove_const_t<T>, Packet>;

// NOLINTBEGIN(bugprone-branch-clone): packets of equal layout are listed each, as the documents do.
/// Calls io(field, ...) with the fields of `p` after the common head of its kind of packet.
template <class P, class Io>
constexpr void fields(P& p, Io&& io) ABBE_RT {
  if constexpr (kIs<P, Units>) {
    io(p.length, p.angle, p.temperature, p.pressure, p.humidity);
  } else if constexpr (kIs<P, Environment>) {
    io(p.temperature, p.pressure, p.humidity);
  } else if constexpr (kIs<P, Refraction>) {
    io(p.n_interferometer, p.n_adm);
  } else if constexpr (kIs<P, SystemSettings>) {
    io(p.weather_monitor, p.apply_transformation, p.apply_station_orientation, p.keep_last_position,
       p.send_unsolicited_messages, p.send_reflector_position, p.try_mode, p.has_nivel,
       p.has_video_camera);
  } else if constexpr (kIs<P, TrackerClockReading>) {
    io(p.seconds, p.microseconds);

  } else if constexpr (kIs<P, SetUnits>) {
    io(p.units);
  } else if constexpr (kIs<P, SetStationOrientation>) {
    io(p.translation, p.rotation);
  } else if constexpr (kIs<P, SetTransformation>) {
    io(p.translation, p.rotation, p.scale);
  } else if constexpr (kIs<P, SetEnvironmentParams>) {
    io(p.environment);
  } else if constexpr (kIs<P, SetRefractionParams>) {
    io(p.refraction);
  } else if constexpr (kIs<P, SetMeasurementMode>) {
    io(p.mode);
  } else if constexpr (kIs<P, SetCoordinateSystemType>) {
    io(p.type);
  } else if constexpr (kIs<P, SetStationaryModeParams>) {
    io(p.measurement_time_ms, p.use_adm);
  } else if constexpr (kIs<P, SetContinuousTimeModeParams>) {
    io(p.time_separation_ms, p.number_of_points, p.use_region, p.region_type);
  } else if constexpr (kIs<P, SetContinuousDistanceModeParams>) {
    io(p.spatial_distance, p.number_of_points, p.use_region, p.region_type);
  } else if constexpr (kIs<P, SetReflector>) {
    io(p.internal_id);
  } else if constexpr (kIs<P, SetSearchParams>) {
    io(p.radius, p.timeout_ms);
  } else if constexpr (kIs<P, SetSystemSettings>) {
    io(p.settings);
  } else if constexpr (kIs<P, GoPosition>) {
    io(p.position, p.use_adm);
  } else if constexpr (kIs<P, FindReflector>) {
    io(p.approximate_distance);
  } else if constexpr (kIs<P, SetStatisticMode>) {
    io(p.stationary, p.continuous);
  } else if constexpr (kIs<P, SetTriggerSource>) {
    io(p.source);
  } else if constexpr (kIs<P, SetExternTriggerParams>) {
    io(p.clock_transition, p.mode, p.start_signal, p.minimal_time_delay);
  } else if constexpr (kIs<P, SetLongSystemParameter>) {
    io(p.parameter, p.value);
  } else if constexpr (kIs<P, GetLongSystemParameter>) {
    io(p.parameter);

  } else if constexpr (kIs<P, SystemStatusAnswer>) {
    io(p.last_result, p.tracker_processor, p.laser, p.adm, p.version_major, p.version_minor,
       p.version_build, p.weather_monitor, p.flags, p.serial_number);
  } else if constexpr (kIs<P, TrackerStatusAnswer>) {
    io(p.tracker);
  } else if constexpr (kIs<P, UnitsAnswer>) {
    io(p.units);
  } else if constexpr (kIs<P, EnvironmentAnswer>) {
    io(p.environment);
  } else if constexpr (kIs<P, RefractionAnswer>) {
    io(p.refraction);
  } else if constexpr (kIs<P, ReflectorAnswer>) {
    io(p.internal_id);
  } else if constexpr (kIs<P, ReflectorsAnswer>) {
    io(p.total, p.internal_id, p.target_type, p.surface_offset, p.name);
  } else if constexpr (kIs<P, SystemSettingsAnswer>) {
    io(p.settings);
  } else if constexpr (kIs<P, LongSystemParameterAnswer>) {
    io(p.parameter, p.value);
  } else if constexpr (kIs<P, MeasurementStatusInfoAnswer>) {
    io(p.last_result, p.bits);
  } else if constexpr (kIs<P, ObjectTemperatureAnswer>) {
    io(p.temperature);
  } else if constexpr (kIs<P, TriggerBoardInfoAnswer>) {
    io(p.card_type, p.fpga_version, p.max_trigger_frequency_hz, p.error);
  } else if constexpr (kIs<P, TrackerInfoAnswer>) {
    io(p.sensor_type, p.name, p.serial_number, p.other, p.max_data_rate_hz, p.more);

  } else if constexpr (kIsSetting<std::remove_const_t<P>>) {
    io(p.set);

  } else if constexpr (kIs<P, ErrorResponse>) {
    io(p.command, p.status);
  } else if constexpr (kIs<P, StatusChange>) {
    io(p.event);
  } else if constexpr (kIs<P, SingleResult>) {
    io(p.status, p.mode, p.try_mode, p.value, p.std_dev, p.std_total, p.pointing_error,
       p.apriori_std, p.apriori_total, p.environment);
  } else if constexpr (kIs<P, ReflectorPosition>) {
    io(p.status, p.value);
  } else if constexpr (kIs<P, MultiPoint>) {
    io(p.status, p.time, p.value);
  } else if constexpr (kIs<P, MultiPointStatistics>) {
    io(p.apriori_std, p.apriori_total, p.covariance);
  } else if constexpr (kIs<P, ExtendedMultiPoint>) {
    io(p.point, p.statistics);
  }
  // Acknowledge and the bare requests have no fields of their own.
}
// NOLINTEND(bugprone-branch-clone)

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
