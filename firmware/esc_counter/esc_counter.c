/* Motor speed from the commutation pulses of a speed controller, for an ATmega328P at 16 MHz (Arduino Nano, Uno, Pro).
 *
 * Pulses, one per electrical period, come in at ICP1 (Arduino pin D8). Timer 1 captures the time of each rising edge to
 * 0.5 us. The time of ten electrical periods goes out at TXD (Arduino pin D1, or USB) at 115200 baud, as frames of eleven
 * bytes (the "framed" variant of daq/sensors/esc_counter.py):
 *
 *   0    0xA6        start of frame
 *   1    sequence    counts frames modulo 256
 *   2    flags       bit 0: no pulse for 0.5 s, the motor is stopped; bit 1: the pulses do not come evenly, so that the
 *                    period may be wrong by more than 2 %; bit 2: no new period. With bit 0 or 2 the period is 0
 *   3-6  period      32 bits, most significant byte first, microseconds for ten electrical periods
 *   7    captured    pulses since the last frame; this count and the next two end at 255
 *   8    rejected    of these, pulses that came too early
 *   9    inserted    pulses that were missing, and were counted all the same
 *   10   CRC-8       of bytes 1 to 9: polynomial 0x07, initial value 0
 *
 * A frame is sent with each new period, at most every 10 ms, otherwise every 50 ms, and every 0.5 s while the motor is
 * stopped. The period is the mean over all pulses since the last one, ten at least: a revolution of a motor with uneven
 * magnets counts more than once.
 *
 * Single pulses too many or too few do not count. A motor's speed changes little from one electrical period to the next,
 * so an interval below 3/4 of the mean of those before is noise, and one of twice the mean has lost a pulse. A false pulse
 * in the last quarter of a period passes for the true one. If a third or more of the intervals do not fit, the motor has
 * another speed, and counting begins again.
 *
 * Bit 1 is set if the two pulses at the ends are together further from where they are expected than 2 % of the whole
 * time, or if an interval differs from the one before by an eighth in the mean: then an echo comes with each pulse.
 *
 * The pulses of a decade counter (one per ten electrical periods) need -DPULSES_PER_PERIOD=1.
 */

#include <avr/interrupt.h>
#include <avr/io.h>
#include <avr/wdt.h>
#include <stdbool.h>
#include <stdint.h>
#include <util/atomic.h>

#ifndef PULSES_PER_PERIOD
#define PULSES_PER_PERIOD 10 /* electrical periods that are timed together */
#endif

#define TICKS_PER_US 2UL                         /* timer 1 at 16 MHz / 8 */
#define TICKS_PER_MS (1000UL * TICKS_PER_US)
#define STANDING_TICKS (500UL * TICKS_PER_MS)    /* without a pulse: the motor is stopped */
#define SENDING_TICKS (10UL * TICKS_PER_MS)      /* shortest time between two frames */
#define COUNTING_TICKS (50UL * TICKS_PER_MS)     /* longest time between two frames while pulses come */
#define SHORTEST_TICKS (20UL * TICKS_PER_US)     /* between two pulses: 2/3 of ten periods in 300 us */
#define MISFIT 2                                 /* suspicion grows by this with an interval that does not fit, */
#define FIT 1                                    /* falls by this with one that does, */
#define ANOTHER_SPEED 6                          /* and from here on the motor is believed to have another speed */

#define LARGEST_END_SHARE 50                     /* 1/50 of the whole time: both ends off by more make it uneven */
#define LARGEST_STEP_SHARE 8                     /* 1/8 of an interval, from one to the next, in the mean */

#define START_OF_FRAME 0xA6
#define FLAG_STOPPED 0x01
#define FLAG_UNEVEN 0x02
#define FLAG_NO_PERIOD 0x04

static volatile uint16_t overflows; /* of timer 1: the upper half of the time */

/* Shared by the capture interrupt and the main loop. */
static volatile bool seen;             /* a pulse has come since the last stop */
static volatile uint32_t last_pulse;   /* its time, in ticks */
static volatile bool complete;         /* `measured` and `periods` are new */
static volatile uint32_t measured;     /* ticks of `periods` electrical periods */
static volatile uint16_t periods;
static volatile uint8_t captured, rejected, inserted; /* since the last frame, at most 255 */

/* Of the capture interrupt alone. */
static uint32_t window_start; /* time of the pulse from which periods are counted */
static uint16_t counted;      /* periods since then */
static uint32_t start_off;    /* by how much that pulse came early or late */
static uint32_t steps;        /* sum of the differences from one interval to the next */
static uint32_t last_off;     /* by how much the latest pulse came early or late */
static uint32_t before;       /* the latest interval; 0 at the beginning */
static uint32_t interval;     /* running mean of those that fitted, or 0 */
static uint8_t suspicion;     /* that the motor has another speed */

static void begin_window(uint32_t now, uint32_t off) {
    window_start = now;
    counted = 0;
    start_off = off;
    steps = 0;
    complete = false;
}

static void count(volatile uint8_t *counter) {
    if (*counter < 255) {
        (*counter)++;
    }
}

static uint32_t difference(uint32_t a, uint32_t b) { return a > b ? a - b : b - a; }

ISR(TIMER1_OVF_vect) { overflows++; }

ISR(TIMER1_CAPT_vect) {
    uint16_t low = ICR1;
    uint16_t high = overflows;
    if ((TIFR1 & _BV(TOV1)) && low < 0x8000) { /* the overflow came before the capture and is not yet counted */
        high++;
    }
    uint32_t now = (uint32_t)high << 16 | low;

    if (!seen) {
        seen = true;
        last_pulse = now;
        interval = 0;
        suspicion = 0;
        before = 0;
        count(&captured);
        begin_window(now, 0);
        return;
    }
    uint32_t passed = now - last_pulse;
    if (passed < SHORTEST_TICKS) {
        return; /* ringing of the edge */
    }
    count(&captured);
    uint8_t spanned = 1;
    uint32_t off = 0;
    if (interval) {
        bool early = passed < interval / 2 + interval / 4;
        bool late = passed > interval + interval / 2;
        if (early || late) {
            suspicion += MISFIT;
            if (suspicion >= ANOTHER_SPEED || passed > 2 * interval + interval / 2) {
                interval = 0;
                suspicion = 0;
                before = 0;
                last_pulse = now;
                count(&rejected);
                begin_window(now, 0);
                return;
            }
            if (early) {
                count(&rejected);
                return; /* noise: the time still runs from the last true pulse */
            }
            count(&inserted);
            spanned = 2; /* a pulse is lost */
            passed /= 2;
        } else if (suspicion) {
            suspicion -= FIT;
        }
        off = difference(passed, interval);
        interval = (interval + passed) / 2;
    } else {
        interval = passed;
    }
    if (before) {
        steps += difference(passed, before);
    }
    before = passed;
    last_pulse = now;
    last_off = off;
    counted += spanned;
    if (counted >= PULSES_PER_PERIOD) {
        measured = now - window_start;
        periods = counted;
        complete = true;
    }
}

static uint32_t time_now(void) {
    uint16_t low, high;
    ATOMIC_BLOCK(ATOMIC_RESTORESTATE) {
        low = TCNT1;
        high = overflows;
        if ((TIFR1 & _BV(TOV1)) && low < 0x8000) {
            high++;
        }
    }
    return (uint32_t)high << 16 | low;
}

static uint8_t crc8(uint8_t crc, uint8_t byte) {
    crc ^= byte;
    for (uint8_t bit = 0; bit < 8; bit++) {
        crc = crc & 0x80 ? (uint8_t)(crc << 1) ^ 0x07 : (uint8_t)(crc << 1);
    }
    return crc;
}

static void send_byte(uint8_t byte) {
    while (!(UCSR0A & _BV(UDRE0))) {
    }
    UDR0 = byte;
}

static void send_frame(uint32_t period_us, uint8_t flags) {
    static uint8_t sequence;
    uint8_t body[9] = {sequence++,
                       flags,
                       (uint8_t)(period_us >> 24),
                       (uint8_t)(period_us >> 16),
                       (uint8_t)(period_us >> 8),
                       (uint8_t)period_us};
    ATOMIC_BLOCK(ATOMIC_RESTORESTATE) {
        body[6] = captured;
        body[7] = rejected;
        body[8] = inserted;
        captured = rejected = inserted = 0;
    }
    uint8_t crc = 0;
    send_byte(START_OF_FRAME);
    for (uint8_t i = 0; i < sizeof body; i++) {
        send_byte(body[i]);
        crc = crc8(crc, body[i]);
    }
    send_byte(crc);
}

int main(void) {
    MCUSR = 0; /* else a reset by the watchdog keeps the watchdog at its shortest time */
    wdt_enable(WDTO_250MS);

    UBRR0 = 16; /* 115200 baud at 16 MHz with U2X: 2.1 % fast, as every board of this kind */
    UCSR0A = _BV(U2X0);
    UCSR0C = _BV(UCSZ01) | _BV(UCSZ00);
    UCSR0B = _BV(TXEN0);

    PORTB |= _BV(PORTB0); /* pull-up at ICP1: an open wire gives no pulses */
    TCCR1A = 0;
    TCCR1B = _BV(ICNC1) | _BV(ICES1) | _BV(CS11); /* noise canceler, rising edge, clock / 8 */
    TIMSK1 = _BV(ICIE1) | _BV(TOIE1);
    sei();

    uint32_t last_sent = time_now();
    for (;;) {
        wdt_reset();
        uint32_t now = time_now();
        uint32_t since_pulse;
        bool ready;
        uint32_t ticks = 0;
        uint16_t of_periods = PULSES_PER_PERIOD;
        uint32_t ends_off = 0, all_steps = 0;
        bool has_stopped = false;
        bool may_send = now - last_sent >= SENDING_TICKS;
        ATOMIC_BLOCK(ATOMIC_RESTORESTATE) {
            ready = complete && may_send;
            if (ready) {
                ticks = measured;
                of_periods = periods;
                ends_off = start_off + last_off;
                all_steps = steps;
                begin_window(last_pulse, last_off);
            }
            since_pulse = now - last_pulse;
            if ((int32_t)since_pulse < 0) { /* the pulse came after `now` was read */
                since_pulse = 0;
            }
            if (seen && since_pulse >= STANDING_TICKS) {
                seen = false;
                complete = false;
                has_stopped = true;
            }
        }
        if (ready) {
            bool uneven = ends_off * LARGEST_END_SHARE > ticks || all_steps * LARGEST_STEP_SHARE > ticks;
            if (of_periods != PULSES_PER_PERIOD) {
                ticks = ticks / of_periods * PULSES_PER_PERIOD + ticks % of_periods * PULSES_PER_PERIOD / of_periods;
            }
            send_frame((ticks + TICKS_PER_US / 2) / TICKS_PER_US, uneven ? FLAG_UNEVEN : 0);
            last_sent = now;
        } else if (has_stopped || now - last_sent >= (seen ? COUNTING_TICKS : STANDING_TICKS)) {
            send_frame(0, seen ? FLAG_NO_PERIOD : FLAG_STOPPED);
            last_sent = now;
        }
    }
}
