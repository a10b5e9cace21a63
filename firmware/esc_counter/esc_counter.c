/* Motor speed from the commutation pulses of a speed controller, for an ATmega328P at 16 MHz (Arduino Nano, Uno, Pro).
 *
 * Pulses, one per electrical period, come in at ICP1 (Arduino pin D8). Timer 1 captures the time of each rising edge to
 * 0.5 us. The time of ten electrical periods goes out at TXD (Arduino pin D1, or USB) at 115200 baud, as frames of eight
 * bytes (the "framed" variant of daq/sensors/esc_counter.py):
 *
 *   0    0xA5        start of frame
 *   1    sequence    counts frames modulo 256
 *   2    flags       bit 0: no pulse for 0.5 s, the motor is stopped; the period is then 0
 *   3-6  period      32 bits, most significant byte first, microseconds for ten electrical periods
 *   7    CRC-8       of bytes 1 to 6: polynomial 0x07, initial value 0
 *
 * A frame is sent with each new period, at most every 10 ms, and every 0.5 s while the motor is stopped.
 *
 * Single pulses too many or too few do not count. A motor's speed changes little from one electrical period to the next,
 * so an interval below 3/4 of the mean of those before is noise, and one of twice the mean has lost a pulse. A false pulse
 * in the last quarter of a period passes for the true one; it can shift the end of the ten periods by 2.5 %. If a third
 * or more of the intervals do not fit, the motor has another speed, and counting begins again.
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
#define SHORTEST_TICKS (20UL * TICKS_PER_US)     /* between two pulses: 2/3 of ten periods in 300 us */
#define MISFIT 2                                 /* suspicion grows by this with an interval that does not fit, */
#define FIT 1                                    /* falls by this with one that does, */
#define ANOTHER_SPEED 6                          /* and from here on the motor is believed to have another speed */

#define START_OF_FRAME 0xA5
#define FLAG_STOPPED 0x01

static volatile uint16_t overflows; /* of timer 1: the upper half of the time */

/* Shared by the capture interrupt and the main loop. */
static volatile bool seen;             /* a pulse has come since the last stop */
static volatile uint32_t last_pulse;   /* its time, in ticks */
static volatile bool complete;         /* `measured` and `periods` are new */
static volatile uint32_t measured;     /* ticks of `periods` electrical periods */
static volatile uint8_t periods;

/* Of the capture interrupt alone. */
static uint32_t window_start; /* time of the pulse from which periods are counted */
static uint8_t counted;       /* periods since then */
static uint32_t interval;     /* running mean of those that fitted, or 0 */
static uint8_t suspicion;     /* that the motor has another speed */

static void begin_window(uint32_t now) {
    window_start = now;
    counted = 0;
}

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
        begin_window(now);
        return;
    }
    uint32_t passed = now - last_pulse;
    if (passed < SHORTEST_TICKS) {
        return; /* ringing of the edge */
    }
    uint8_t spanned = 1;
    if (interval) {
        bool early = passed < interval / 2 + interval / 4;
        bool late = passed > interval + interval / 2;
        if (early || late) {
            suspicion += MISFIT;
            if (suspicion >= ANOTHER_SPEED || passed > 2 * interval + interval / 2) {
                interval = 0;
                suspicion = 0;
                last_pulse = now;
                begin_window(now);
                return;
            }
            if (early) {
                return; /* noise: the time still runs from the last true pulse */
            }
            spanned = 2; /* a pulse is lost */
            passed /= 2;
        } else if (suspicion) {
            suspicion -= FIT;
        }
        interval = (interval + passed) / 2;
    } else {
        interval = passed;
    }
    last_pulse = now;
    counted += spanned;
    if (counted >= PULSES_PER_PERIOD) {
        measured = now - window_start;
        periods = counted;
        complete = true;
        begin_window(now);
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

static void send_frame(uint32_t period_us) {
    static uint8_t sequence;
    uint8_t body[6] = {sequence++,
                       period_us ? 0 : FLAG_STOPPED,
                       (uint8_t)(period_us >> 24),
                       (uint8_t)(period_us >> 16),
                       (uint8_t)(period_us >> 8),
                       (uint8_t)period_us};
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
        uint8_t count = PULSES_PER_PERIOD;
        bool may_send = now - last_sent >= SENDING_TICKS;
        ATOMIC_BLOCK(ATOMIC_RESTORESTATE) {
            ready = complete && may_send;
            if (ready) {
                ticks = measured;
                count = periods;
                complete = false;
            }
            since_pulse = now - last_pulse;
            if ((int32_t)since_pulse < 0) { /* the pulse came after `now` was read */
                since_pulse = 0;
            }
            if (seen && since_pulse >= STANDING_TICKS) {
                seen = false;
                complete = false;
            }
        }
        if (ready) {
            if (count != PULSES_PER_PERIOD) { /* the window ended with a lost pulse */
                ticks = ticks / count * PULSES_PER_PERIOD + ticks % count * PULSES_PER_PERIOD / count;
            }
            send_frame((ticks + TICKS_PER_US / 2) / TICKS_PER_US);
            last_sent = now;
        } else if (!seen && now - last_sent >= STANDING_TICKS) {
            send_frame(0);
            last_sent = now;
        }
    }
}
